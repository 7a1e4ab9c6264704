"""Faults of a log as candidates: efforts that were recorded late or with noise, readings that were low-passed."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from fes_pin.data.log import Log
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.decide.rivals import estimates
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.faults.effort_noise import EffortNoise, words_of_noise
from fes_pin.faults.log_faults import EFFORT_NOISE, LATE_EFFORT, LOW_PASS, LogFault, said_of
from fes_pin.faults.misread import NAME as MISREAD
from fes_pin.identify.effort_timing import (
    Lateness,
    lateness_of,
    with_lateness,
    with_timing_of_readings,
    words_of_lateness,
)
from fes_pin.identify.likelihood import LikelihoodProblem, is_simulated
from fes_pin.identify.likelihood_fit import (
    LikelihoodFit,
    at_noise,
    maximum_from,
    refit,
    with_white_process_noise,
)
from fes_pin.identify.recording import low_pass_of, words_of_low_pass
from fes_pin.infer.corrected import Correction
from fes_pin.infer.levels import PARAMETER_PENALTY
from fes_pin.prepare.long_records import in_parts

Fault = LogFault[LikelihoodFit]


class LogFaults(EffortNoise):
    """Estimates of what a log did to efforts and readings, each under an answer for the log as known so far."""

    _late: Lateness | None = None

    def low_pass(self, answer: Diagnosis) -> Fault | None:
        """Return the low pass of the readings; None where no test of lack of fit asks for one.

        For rigs in closed loop `identify.correlation_time` estimates the correlation time of the noise instead.
        """
        restated = any(c.name == MISREAD for c in answer.causes)
        if not answer.remainder.unexplained or answer.is_driven or restated:
            return None
        nominal = answer.nominal
        found = self.in_time(lambda: low_pass_of(nominal.model, nominal.trials), None)
        if found is None:
            return None
        hz, gain = found
        names = [n for t in nominal.trials for n in nominal.model.rig.outputs(t.kind) if n in t]
        log = replace(answer.log, low_pass_hz=hz)
        return Fault(LOW_PASS, answer.log, log, gain, words_of_low_pass(hz, names))

    def effort_noise(self, answer: Diagnosis) -> Fault | None:
        """Return the noise of efforts; None where the answer has no lack of fit or cause that it may explain.

        It is None too where no time is left to estimate it.
        """
        fitted, noise, bare = likeliest(answer), answer.log.effort_noise, None
        if noise:
            bare = self.in_time(lambda: maximum_from(fitted, self.prepared(self.trials)), None)
            if bare is None:
                return None
            gain = bare.sse - fitted.sse
        elif answer.verdict == "adequate" or (found := self.in_time(lambda: self.of(fitted), None)) is None:
            return None
        else:
            noise, gain = found
        plain, log = (replace(answer.log, effort_noise=one) for one in (0.0, noise))
        words = words_of_noise(noise, answer.model.rig.units()["effort"])
        return Fault(EFFORT_NOISE, plain, log, gain, words, bare)

    def lateness(self, answer: Diagnosis) -> Fault | None:
        """Return the delay with which efforts were recorded; None where no time is left to estimate it."""
        late = self.in_time(lambda: self._lateness(answer), None)
        if late is None:
            return None
        self._late, log = late, with_timing_of(answer.log, late.log)
        return Fault(LATE_EFFORT, answer.log, log, late.gain, words_of_lateness(late.log))

    def _lateness(self, answer: Diagnosis) -> Lateness:
        """Return the delay under an answer, or under the nominal model: causes may be mistaken for a delay.

        That of the nominal model counts if the answer has a lack of fit, or a higher criterion.
        """
        nominal, extended = answer.nominal, likeliest(answer)
        row_s = min(t.dt for t in extended.trials)
        as_logged = round(row_s / min(t.dt for t in self.trials)) == 1
        late = lateness_of(extended, row_s, as_logged)
        if late.is_certain or not answer.causes:
            return late
        plain = lateness_of(nominal, row_s, as_logged)
        criterion = plain.cost + PARAMETER_PENALTY * (nominal.degrees + 1)
        counts = answer.remainder.unexplained or criterion < extended.criterion
        return plain if plain.is_certain and counts else late

    def with_timing(self, answer: Diagnosis) -> Diagnosis:
        """Return an answer with intervals that include the uncertain timing of readings and efforts."""
        row_s, fitted, late = min(t.dt for t in self.trials), answer.extended, self._late

        def widened(wide: LikelihoodFit, timed: Log) -> LikelihoodFit:
            log = with_timing_of(answer.log, timed)
            moved = self.prepared([log.applied(t) for t in self.trials])
            return with_lateness(wide, maximum_from(fitted, moved))

        wide = known = self.in_time(lambda: with_timing_of_readings(fitted, row_s), fitted)
        if late is not None and with_timing_of(answer.log, late.log) == answer.log:
            at_most = late.at_most
            wide = self.in_time(lambda: widened(known, at_most), known)
        causes = tuple(c if c.words else replace(c, parameters=estimates(wide, c.name)) for c in answer.causes)
        return replace(answer, extended=wide, causes=causes)


ASKED_OF_READINGS: tuple[Callable[[LogFaults, Diagnosis], Fault | None], ...] = (LogFaults.low_pass,)
ASKED_OF_EFFORTS = (LogFaults.effort_noise, LogFaults.lateness)
"""Faults in the order in which they are estimated, of logs without and with efforts in closed loop."""


def likeliest(answer: Diagnosis) -> LikelihoodFit:
    """Return the maximum of the likelihood of the set of an answer."""
    return answer.likeliest or answer.extended


def with_timing_of(log: Log, timed: Log) -> Log:
    """Return a log with the timing of efforts of another."""
    return replace(log, effort_late_s=timed.effort_late_s, effort_over_s=timed.effort_over_s)


def comparable(one: LikelihoodFit, other: LikelihoodFit) -> tuple[LikelihoodFit, LikelihoodFit]:
    """Return two fits of the same readings under noise of the same kind.

    Trials are cut into parts if those of one are: in a corrected record a controller may no longer answer. Measurement
    noise has the longer correlation time, and process noise is white if that of one is, else as slow. Free simulations
    have the autoregressive noise that their own residuals support.
    """
    one, other = _in_parts_as(one, other), _in_parts_as(other, one)
    noises = one.noise, other.noise
    correlation_s, slowest_s = max(n.correlation_s for n in noises), max(n.slowest_s for n in noises)
    timed = any(noise.timed for noise in noises)
    return _as_random(one, correlation_s, slowest_s, timed), _as_random(other, correlation_s, slowest_s, timed)


def _in_parts_as(fitted: LikelihoodFit, other: LikelihoodFit) -> LikelihoodFit:
    """Return a fit, again to its trials in parts where those of another fit of these are in more parts."""
    if len(fitted.trials) >= len(other.trials):
        return fitted
    return refit(fitted, in_parts(fitted.model.rig, fitted.trials))


def _as_random(fitted: LikelihoodFit, correlation_s: float, slowest_s: float, timed: bool) -> LikelihoodFit:
    if (fitted.noise.correlation_s, fitted.noise.slowest_s) != (correlation_s, slowest_s):
        noise = replace(fitted.noise, correlation_s=correlation_s, slowest_s=slowest_s)
        fitted = maximum_from(fitted, fitted.trials, noise)
    if is_simulated(fitted.noise, fitted.trials):
        problem = LikelihoodProblem(fitted.model, fitted.trials, fitted.noise)
        problem.noise = problem.with_orders(fitted.values, fitted.unknowns)
        problem.renew(fitted.values, fitted.unknowns)
        return at_noise(fitted, problem.noise)
    return with_white_process_noise(fitted) if timed and not fitted.noise.timed else fitted


def with_tests(answer: Diagnosis, tests: Sequence[Correction]) -> Diagnosis:
    """Return an answer with further tests of faults of its record; of a fault that was tested again, the last."""
    known = {one.name: one for one in (*(answer.why.corrections if answer.why else ()), *tests)}
    return replace(answer, why=answer.why and replace(answer.why, corrections=tuple(known.values())))


def with_warnings(answer: Diagnosis, tests: Sequence[Correction], trials: Sequence[Trial]) -> Diagnosis:
    """Return an answer with a warning about each fault of the log that is corrected."""
    return replace(answer, warnings=(*reversed(said_of(tests, trials)), *answer.warnings))
