"""Faults of a log: efforts that were recorded late or with noise."""

from dataclasses import replace

from fes_pin.data.log import Log
from fes_pin.diagnosis.decide.rivals import estimates
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.faults.effort_noise import EffortNoise, words_of_noise
from fes_pin.identify.effort_timing import (
    Lateness,
    lateness_of,
    with_lateness,
    with_timing_of_readings,
    words_of_lateness,
)
from fes_pin.identify.likelihood_fit import LikelihoodFit, maximum_from, with_white_process_noise
from fes_pin.infer.levels import PARAMETER_PENALTY


class LogFaults(EffortNoise):
    """Estimates of what a log did to the effort that drives a rig: its noise and its delay."""

    def effort_noise_of(self, diagnosis: Diagnosis) -> float:
        """Return the same under a diagnosis; 0 where the efforts as recorded are likelier than the corrected ones."""
        fitted, known = diagnosis.extended, diagnosis.log.effort_noise
        if known:
            as_recorded = self.prepared(self.trials)
            return known * self.in_time(lambda: float(fitted.sse < maximum_from(fitted, as_recorded).sse), 1.0)
        return self.in_time(lambda: self.of(fitted), 0.0) if diagnosis.verdict != "adequate" else 0.0

    def lateness(self, diagnosis: Diagnosis) -> Lateness | None:
        """Return the delay with which efforts were recorded; None where there is none, or no time to estimate it.

        Causes that were found may be mistaken for a delay. The delay is therefore estimated with the nominal model too;
        it counts if the set has a lack of fit, or if it gives a lower criterion than all causes that were found.
        """
        return self.in_time(lambda: self._lateness(diagnosis), None)

    def _lateness(self, diagnosis: Diagnosis) -> Lateness | None:
        nominal, extended = diagnosis.nominal, diagnosis.extended
        row_s = min(t.dt for t in extended.trials)
        as_logged = round(row_s / min(t.dt for t in self.trials)) == 1
        late = lateness_of(extended, row_s, as_logged)
        if late is None and diagnosis.causes:
            late = lateness_of(nominal, row_s, as_logged)
            if late is not None and not diagnosis.remainder.unexplained:
                criterion = late.cost + PARAMETER_PENALTY * (nominal.degrees + 1)
                late = late if criterion < extended.criterion else None
        return late

    def with_timing(self, diagnosis: Diagnosis, late: Lateness | None) -> Diagnosis:
        """Return the diagnosis with intervals that include the uncertain timing of readings and efforts.

        Parameters
        ----------
        late
            The delay of the efforts, if they were moved.
        """
        row_s, fitted = min(t.dt for t in self.trials), diagnosis.extended

        def widened(wide: LikelihoodFit, timed: Log) -> LikelihoodFit:
            log = with_timing_of(diagnosis.log, timed)
            moved = self.prepared([log.applied(t) for t in self.trials])
            return with_lateness(wide, maximum_from(fitted, moved))

        wide = known = self.in_time(lambda: with_timing_of_readings(fitted, row_s), fitted)
        if late is not None:
            wide = self.in_time(lambda: widened(known, late.at_most), known)
        causes = tuple(c if c.words else replace(c, parameters=estimates(wide, c.name)) for c in diagnosis.causes)
        return replace(diagnosis, extended=wide, causes=causes)


def with_timing_of(log: Log, timed: Log) -> Log:
    """Return a log with the timing of efforts of another."""
    return replace(log, effort_late_s=timed.effort_late_s, effort_over_s=timed.effort_over_s)


def likelier(other: Diagnosis, one: Diagnosis) -> Diagnosis:
    """Return the likelier of two diagnoses of the same readings with different efforts.

    It has the lower criterion, both at the longer correlation time of measurement noise. If the process noise of one is
    white, both are fitted with white process noise.
    """
    fits = [d.extended for d in (other, one)]
    correlation_s, timed = max(f.noise.correlation_s for f in fits), any(f.noise.timed for f in fits)
    first, second = (_as_random(f, correlation_s, timed) for f in fits)
    return other if first.criterion < second.criterion else one


def with_words(diagnosis: Diagnosis) -> Diagnosis:
    """Return the diagnosis with warnings about efforts that are corrected."""
    log, said = diagnosis.log, []
    if log.effort_late_s or log.effort_over_s:
        said.append(words_of_lateness(log))
    if log.effort_noise:
        said.append(words_of_noise(log.effort_noise, diagnosis.model.rig.units()["effort"]))
    return replace(diagnosis, warnings=(*said, *diagnosis.warnings))


def _as_random(fitted: LikelihoodFit, correlation_s: float, timed: bool) -> LikelihoodFit:
    """Return the fit at a correlation time of measurement noise, with white process noise if asked for."""
    if fitted.noise.correlation_s != correlation_s:
        fitted = maximum_from(fitted, fitted.trials, replace(fitted.noise, correlation_s=correlation_s))
    return with_white_process_noise(fitted) if timed and not fitted.noise.timed else fitted
