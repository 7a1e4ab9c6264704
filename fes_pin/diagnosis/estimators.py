"""What was found, judged again where errors of form passed for a random effort that lasts: `identify.process_noise`."""

from __future__ import annotations

import numpy as np

from fes_pin.data.schema import IMPOSED
from fes_pin.diagnosis.decide.by_prediction import FEWEST, best_predicting
from fes_pin.diagnosis.decide.rivals import not_excluded
from fes_pin.diagnosis.errors_ahead import squared_errors
from fes_pin.diagnosis.search.cause_sets import names_of
from fes_pin.diagnosis.search.likelihood_fits import MEASUREMENT, PROCESS, WHITE
from fes_pin.diagnosis.search.likelihood_models import Found, LikelihoodSearch, NominalFitError
from fes_pin.identify.likelihood_fit import LikelihoodFit, with_white_process_noise
from fes_pin.identify.process_noise import step_s
from fes_pin.infer.held_out import held_out_gain
from fes_pin.infer.levels import NOTHING_PERCENT
from fes_pin.infer.search import Policy
from fes_pin.workers import OutOfTime, in_parallel, time_limit

WHITE_PROCESS_NOISE = (
    "what acts at random was taken for new in every sample: beside what lasts, the model foretold less"
)
"""What is told of it."""


def searched(search: LikelihoodSearch) -> tuple[LikelihoodSearch, Found]:
    """A search that has run: without process noise first where no controller answers, with it where that improves.

    Of a set without process noise every prediction is a free simulation, which takes a third of the time. Process noise
    must improve the penalised likelihood of the best set; else nothing of it is needed.
    """
    found = search.run()
    if search.was_stopped or search.models.noise != MEASUREMENT:
        return search, found
    try:
        with time_limit(search.seconds_left):
            acting = search.models.with_process_noise(found.best)
    except (ArithmeticError, np.linalg.LinAlgError, OutOfTime):
        return search, found
    if not acting.criterion < found.best.criterion:
        return search, found
    return _with_process_noise(search) or (search, found)


def least_error(search: LikelihoodSearch) -> tuple[LikelihoodSearch, Found] | None:
    """The same causes searched by the least error of free simulations, every error weighed alike; None if time is up.

    Where a model is not right, a likelihood with process noise or autoregressive measurement noise takes what it misses
    for noise. Least squares give the model that predicts best from the inputs alone (Ljung, System Identification,
    2nd ed., section 8.3). Causes are chosen by what they predict of trials left out; where there are too few of these,
    none is.
    """
    if search.models.answered or search.was_stopped:
        return None
    other = LikelihoodSearch(search.models.with_noise(WHITE), search.progress)
    try:
        with time_limit(search.seconds_left):
            if len(search.models.trials) < FEWEST:
                other.models.nominal()
                return other, other.result(())
            found = other.run()
            return None if other.was_stopped else (other, other.result(best_predicting(other, names_of(found.best))))
    except (ArithmeticError, np.linalg.LinAlgError, OutOfTime, NominalFitError):
        return None


def _with_process_noise(search: LikelihoodSearch) -> tuple[LikelihoodSearch, Found] | None:
    """The same causes searched with process noise; None if that did not end."""
    other = LikelihoodSearch(search.models.with_noise(PROCESS), search.progress)
    try:
        with time_limit(search.seconds_left):
            found = other.run()
    except (ArithmeticError, np.linalg.LinAlgError, OutOfTime, NominalFitError):
        return None
    return None if other.was_stopped else (other, found)


def found_with_white_process_noise(search: LikelihoodSearch, found: Found) -> LikelihoodFit | None:
    """What was found, beside random efforts that are new in every sample; None where none that lasts acts."""
    if search.was_stopped or not search.models.answered or not _may_last(found.best):
        return None
    try:
        with time_limit(search.seconds_left):
            return with_white_process_noise(found.best)
    except (ArithmeticError, np.linalg.LinAlgError, OutOfTime):
        return None


def judged_again(search: LikelihoodSearch, found: Found, white: LikelihoodFit) -> tuple[LikelihoodSearch, Found] | None:
    """What was found beside random efforts that are new in every sample; None where it gains nothing there.

    It gains where its errors over the horizon are less, by a thousandth of what the nominal model gets wrong: a random
    effort that lasts is foretold as far as it does, and what takes its place gains nothing. Nothing is claimed by that.
    No cause is searched for: what is left has a colour that new efforts have not, and a likelihood without it tells
    causes apart that it should not.

    Parameters
    ----------
    fresh
        Of `found_with_white_process_noise`.
    """
    try:
        with time_limit(search.seconds_left):
            if not _predicts_better(white, search, found):
                return None
            sets = search.models.begun_with([white, *_parts_and_rivals(found)])
            again = LikelihoodSearch(sets, search.progress, Policy(given=names_of(white)))
        with time_limit(search.seconds_left):
            other = again.run()
    except (ArithmeticError, np.linalg.LinAlgError, OutOfTime, NominalFitError):
        return None
    return None if again.was_stopped else (again, other)


def _predicts_better(white: LikelihoodFit, search: LikelihoodSearch, found: Found) -> bool:
    """Whether errors over the horizon are less beside efforts that are new."""
    many = [[(f, found.best, f.trials)] for f in (found.nominal, found.best, white)]
    nominal, coloured, new = (squared_errors(one, search.models.horizon_s) for one in many)
    return held_out_gain(nominal, coloured, new, search.models.seed).percent > NOTHING_PERCENT


def _parts_and_rivals(found: Found) -> list[LikelihoodFit]:
    """The parts of what was found, and what cannot be told from it, beside efforts that are new."""
    parts = {names_of(f): f for f in (*found.without.values(), found.nominal)}
    parts |= {names_of(f): f for many in found.rivals.values() for f in not_excluded(found.best, many)}
    parts.pop(names_of(found.best), None)
    return in_parallel(with_white_process_noise, list(parts.values()))


def _may_last(fitted: LikelihoodFit) -> bool:
    """Whether something acts at random on a rig whose starts are unknown, and lasts longer than a reading.

    Where the motion is imposed effort itself is read, and a reading of it lasts as it does; where a rig begins at rest
    noise that foretells itself is told from a random effort (`LikelihoodFits.nominal`).
    """
    is_coloured = any(fitted.noise.time[n] > step_s(fitted.noise, fitted.trials) for n in fitted.noise.acting)
    return is_coloured and all(t.kind != IMPOSED and fitted.model.rig.unknowns(t.kind) for t in fitted.trials)


__all__ = ["WHITE_PROCESS_NOISE", "found_with_white_process_noise", "judged_again", "least_error", "searched"]
