"""Faults of a log: efforts that were recorded late or with noise.

A measured current has noise of its own, which moves nothing. A filter takes it for effort: a rig in closed loop then
seems to move less than the recorded effort would move it, as if dry friction held it. The effort that the controller
computes from its reading separates the noise from the effort that acted (`data.answered`); the likelihood of a model
estimates how much noise there is.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from fes_pin.data.answered import ControllerAnswer
from fes_pin.data.log import Log, answered, quiet
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.decide.rivals import estimates
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.diagnosis.search.likelihood_fits import LikelihoodFits
from fes_pin.identify.effort_timing import (
    Lateness,
    lateness_of,
    with_lateness,
    with_timing_of_readings,
    words_of_lateness,
)
from fes_pin.identify.likelihood_fit import LikelihoodFit, maximum_from, with_white_process_noise
from fes_pin.infer.levels import CERTAIN_GAIN, EFFORT_NOISE_SHARE, PARAMETER_PENALTY
from fes_pin.models.model import Model
from fes_pin.workers import attempted, in_parallel

T = TypeVar("T")
Prepared = Callable[[Sequence[Trial]], Sequence[Trial]]
"""Preparation of recorded trials before a search fits them."""
TRIED = (0.1, 0.25, 0.5, 0.75)
"""Quantiles of the residual between recorded and computed effort that are tried as the noise. Noise has the same size
everywhere, while other errors of the computed effort do not: they are small in a share of the samples."""


class LogFaults:
    """Estimates of what a log did to the effort that drives a rig.

    Parameters
    ----------
    trials
        All trials as recorded, held-out ones included.
    prepared
        Preparation of trials before they are fitted.
    end
        Time at which searches stop, of `time.perf_counter`.
    """

    def __init__(self, trials: Sequence[Trial], prepared: Prepared, end: float) -> None:
        self.trials, self.prepared, self._end = tuple(trials), prepared, end

    @cached_property
    def answers(self) -> list[ControllerAnswer]:
        """The controller that each trial's effort follows."""
        return in_parallel(answered, self.trials)

    def effort_noise_of_nominal(self, nominal: Model) -> float:
        """Return the noise of recorded efforts under the nominal model, in their unit; 0 where it is not supported."""
        return self._in_time(
            lambda: self._noise(LikelihoodFits(nominal, self.prepared(self.trials), ()).nominal()), 0.0
        )

    def effort_noise_of(self, diagnosis: Diagnosis) -> float:
        """Return the same under a diagnosis; 0 where the efforts as recorded are likelier than the corrected ones."""
        fitted, known = diagnosis.extended, diagnosis.log.effort_noise
        if known:
            as_recorded = self.prepared(self.trials)
            return known * self._in_time(lambda: float(fitted.sse < maximum_from(fitted, as_recorded).sse), 1.0)
        return self._in_time(lambda: self._noise(fitted), 0.0) if diagnosis.verdict != "adequate" else 0.0

    def _noise(self, fitted: LikelihoodFit) -> float:
        """Return the noise of recorded efforts under a fit to the prepared trials; 0 where none is supported."""
        left = np.concatenate([a.left_std for a in self.answers])
        std, time_s = (part.get("effort", 0.0) for part in (fitted.noise.std, fitted.noise.time))
        least = np.sqrt(EFFORT_NOISE_SHARE * 2.0 * std**2 * time_s / min(t.dt for t in self.trials))
        tried = [0.0, *(float(v) for v in np.unique(np.quantile(left, TRIED)) if v > least)]
        if len(tried) == 1:
            return 0.0
        costs = in_parallel(lambda noise: maximum_from(fitted, self.prepared(self._quieted(noise))).sse, tried)
        best = int(np.argmin(costs))
        return tried[best] if costs[best] < costs[0] - CERTAIN_GAIN else 0.0

    def _quieted(self, noise: float) -> list[Trial]:
        """Return the trials with noise of that size removed from their efforts."""
        return [quiet(t, a, noise) for t, a in zip(self.trials, self.answers, strict=True)]

    def lateness(self, diagnosis: Diagnosis) -> Lateness | None:
        """Return the delay with which efforts were recorded; None where there is none, or no time to estimate it.

        Causes that were found may be mistaken for a delay. The delay is therefore estimated with the nominal model too;
        it counts if the set has a lack of fit, or if it gives a lower criterion than all causes that were found.
        """
        return self._in_time(lambda: self._lateness(diagnosis), None)

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

        wide = known = self._in_time(lambda: with_timing_of_readings(fitted, row_s), fitted)
        if late is not None:
            wide = self._in_time(lambda: widened(known, late.at_most), known)
        causes = tuple(c if c.words else replace(c, parameters=estimates(wide, c.name)) for c in diagnosis.causes)
        return replace(diagnosis, extended=wide, causes=causes)

    def _in_time(self, ask: Callable[[], T], otherwise: T) -> T:
        """Return an estimate, or another value if it is not finite or time is over."""
        return attempted(ask, otherwise, self._end - time.perf_counter())


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


def words_of_noise(noise: float, unit: str) -> str:
    """Return a warning about efforts from which noise was removed."""
    return f"the effort was recorded with noise of {noise:.2g} {unit}: it was removed where readings predict the effort"


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
