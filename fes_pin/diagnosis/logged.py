"""Efforts that were recorded late, or with noise: faults of the log, not of the rig."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from fes_pin.data.answered import ControllerAnswer
from fes_pin.data.log import Log, answered
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.decide.rivals import estimates
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.diagnosis.search.likelihood_fits import LikelihoodFits
from fes_pin.identify.effort_noise import Prepared, effort_noise_of, words_of_noise
from fes_pin.identify.effort_timing import (
    Lateness,
    lateness_of,
    with_lateness,
    with_timing_of_readings,
    words_of_lateness,
)
from fes_pin.identify.likelihood_fit import LikelihoodFit, maximum_from, with_white_process_noise
from fes_pin.infer.levels import PARAMETER_PENALTY
from fes_pin.models.model import Model
from fes_pin.workers import OutOfTime, in_parallel, time_limit

T = TypeVar("T")


class LogFaults:
    """What the log of a rig that a recorded effort drives did to that effort.

    Parameters
    ----------
    trials
        As recorded, those that are held out among them.
    prepared
        What a search makes of them before it fits them.
    end
        When searches must have ended, of `time.perf_counter`.
    """

    def __init__(self, trials: Sequence[Trial], prepared: Prepared, end: float) -> None:
        self.trials, self.prepared, self._end = tuple(trials), prepared, end

    @cached_property
    def answers(self) -> list[ControllerAnswer]:
        """What the effort of each trial answers."""
        return in_parallel(answered, self.trials)

    def effort_noise_of_nominal(self, nominal: Model) -> float:
        """Noise of the efforts, in their unit, beside a model without causes; 0 where nothing speaks for it."""
        return self._in_time(
            lambda: self._noise(LikelihoodFits(nominal, self.prepared(self.trials), ()).nominal()), 0.0
        )

    def effort_noise_of(self, diagnosis: Diagnosis) -> float:
        """The same beside a diagnosis; what was taken out for it is put back where efforts are likelier with it."""
        fitted, known = diagnosis.extended, diagnosis.log.effort_noise
        if known:
            return known * self._in_time(lambda: float(fitted.sse < self._as_recorded(fitted).sse), 1.0)
        return self._in_time(lambda: self._noise(fitted), 0.0) if diagnosis.verdict != "adequate" else 0.0

    def _as_recorded(self, fitted: LikelihoodFit) -> LikelihoodFit:
        """The same model on trials with all the noise that their efforts were recorded with."""
        return maximum_from(fitted, self.prepared(self.trials))

    def _noise(self, fitted: LikelihoodFit) -> float:
        return effort_noise_of(fitted, self.trials, self.answers, self.prepared)

    def lateness(self, diagnosis: Diagnosis) -> Lateness | None:
        """How late the efforts were written down; None where they were not, or there is no time to tell.

        What was found may stand for it: the nominal model is asked where something is left beside, or where it is
        cheaper with efforts in time than all that was found.
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
        """The diagnosis with intervals that hold what is not known of when a reading was taken, and an effort acted.

        Parameters
        ----------
        late
            How late the efforts are, if they were moved.
        """
        row_s, fitted = min(t.dt for t in self.trials), diagnosis.extended

        def widened(wide: LikelihoodFit, timed: Log) -> LikelihoodFit:
            log = with_timing_of(diagnosis.log, timed)
            moved = self.prepared([log.applied(t) for t in self.trials])
            return with_lateness(wide, maximum_from(fitted, moved))

        wide = known = self._in_time(lambda: with_timing_of_readings(fitted, row_s), fitted)
        if late is not None:
            wide = self._in_time(lambda: widened(known, late.at_most), known)
        causes = tuple(replace(c, parameters=estimates(wide, c.name)) for c in diagnosis.causes)
        return replace(diagnosis, extended=wide, causes=causes)

    def _in_time(self, ask: Callable[[], T], otherwise: T) -> T:
        """What is told in the time that is left."""
        try:
            with time_limit(self._end - time.perf_counter()):
                return ask()
        except (ArithmeticError, np.linalg.LinAlgError, OutOfTime):
            return otherwise


def with_timing_of(log: Log, timed: Log) -> Log:
    """A log with efforts that acted when another says."""
    return replace(log, effort_late_s=timed.effort_late_s, effort_over_s=timed.effort_over_s)


def likelier(other: Diagnosis, one: Diagnosis) -> Diagnosis:
    """Another diagnosis of the same readings, by other efforts, if it is likelier; else the one."""
    return other if _is_likelier(other.extended, one.extended) else one


def with_words(diagnosis: Diagnosis) -> Diagnosis:
    """The diagnosis with what is to be said of efforts that are not as they were recorded."""
    log, said = diagnosis.log, []
    if log.effort_late_s or log.effort_over_s:
        said.append(words_of_lateness(log))
    if log.effort_noise:
        said.append(words_of_noise(log.effort_noise, diagnosis.model.rig.units()["effort"]))
    return replace(diagnosis, warnings=(*said, *diagnosis.warnings))


def _is_likelier(one: LikelihoodFit, other: LikelihoodFit) -> bool:
    """True if the same readings are foretold better for as many parameters: those that are news to both.

    Beside random efforts that are new in every sample where those of one are.
    """
    both = one.noise, other.noise
    correlation_s, timed = max(n.correlation_s for n in both), any(n.timed for n in both)
    first, second = (_as_random(f, correlation_s, timed) for f in (one, other))
    return first.criterion < second.criterion


def _as_random(fitted: LikelihoodFit, correlation_s: float, timed: bool) -> LikelihoodFit:
    """The fit to readings so far apart, and beside random efforts that are new in every one if these are to be."""
    if fitted.noise.correlation_s != correlation_s:
        fitted = maximum_from(fitted, fitted.trials, replace(fitted.noise, correlation_s=correlation_s))
    return with_white_process_noise(fitted) if timed and not fitted.noise.timed else fitted
