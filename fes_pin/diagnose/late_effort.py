"""Efforts that were written down after they acted: a fault of the record, not of the rig."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from fes_pin.data.log import Log
from fes_pin.data.study import Study
from fes_pin.diagnose.result import Diagnosis
from fes_pin.identify.fit import Fit
from fes_pin.identify.lateness import lateness_of, words_of_lateness
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.turns import maximise
from fes_pin.workers import OutOfTime, time_limit


def late_by(diagnosis: Diagnosis, end: float) -> float | None:
    """How late the efforts of a driven rig were written down, s; None where they were not, or there is no time to tell.

    Where something is left beside the causes that were found, they may stand for it: then the nominal model is asked.

    Parameters
    ----------
    end
        When searches must have ended, of `time.perf_counter`.
    """
    fitted, trials = diagnosis.extended, diagnosis.study.trials
    if fitted.doubt is None or not all("effort" in fitted.model.rig.input_columns(t) for t in trials):
        return None
    try:
        with time_limit(end - time.perf_counter()):
            row_s = min(t.dt for t in trials)
            late_s = lateness_of(fitted, row_s)
            if late_s is None and diagnosis.causes and diagnosis.remainder.unexplained:
                late_s = lateness_of(diagnosis.nominal, row_s)
            return late_s
    except (ArithmeticError, np.linalg.LinAlgError, OutOfTime):
        return None


def in_time(study: Study, late_s: float) -> Study:
    """The study with its efforts where they acted."""
    log = Log(effort_late_s=late_s)
    return replace(study, trials=tuple(log.applied(t) for t in study.trials))


def better_timed(timed: Diagnosis, recorded: Diagnosis, late_s: float) -> Diagnosis:
    """The diagnosis with efforts in time, if it is likelier than that of the record; else that."""
    if not _is_likelier(timed.extended, recorded.extended):
        return recorded
    log = replace(timed.log, effort_late_s=late_s)
    return replace(timed, log=log, warnings=(words_of_lateness(late_s), *timed.warnings))


def _is_likelier(timed: Fit, recorded: Fit) -> bool:
    """True if the same readings are foretold better for as many parameters: those that are news to both."""
    lasts_s = max(f.doubt.lasts_s for f in (timed, recorded) if f.doubt is not None)
    one, other = (_with_noise_that_lasts(f, lasts_s) for f in (timed, recorded))
    return one.price < other.price


def _with_noise_that_lasts(fitted: Fit, lasts_s: float) -> Fit:
    """The fit to readings so far apart."""
    if fitted.doubt is None or fitted.doubt.lasts_s == lasts_s:
        return fitted
    problem = LikelihoodProblem(fitted.model, fitted.trials, replace(fitted.doubt, lasts_s=lasts_s))
    return maximise(problem, fitted.values, fitted.unknowns)
