"""Estimators of one study: without process noise, with coloured or white process noise, by least squares."""

from fes_pin.data.schema import IMPOSED
from fes_pin.diagnosis.decide.by_prediction import FEWEST, best_predicting
from fes_pin.diagnosis.decide.rivals import not_excluded
from fes_pin.diagnosis.errors_ahead import squared_errors
from fes_pin.diagnosis.likelihood_models import Found, LikelihoodModels, LikelihoodSearch
from fes_pin.identify.afar import is_rounding
from fes_pin.identify.likelihood_fit import LikelihoodFit, with_white_process_noise
from fes_pin.identify.process_noise import step_s
from fes_pin.infer.held_out import held_out_gain
from fes_pin.infer.levels import NOTHING_PERCENT
from fes_pin.infer.search import Policy
from fes_pin.search.likelihood_fits import MEASUREMENT, PROCESS
from fes_pin.workers import attempted, in_parallel

WHITE_PROCESS_NOISE = (
    "process noise is modelled as white: with coloured process noise the same model predicted worse over the horizon"
)
"""Warning where the estimator with white process noise is the answer."""


def searched(search: LikelihoodSearch) -> tuple[LikelihoodSearch, Found]:
    """Run a search and return it with its result: without process noise first where the rig is not in closed loop.

    Without process noise every prediction is a free simulation, which takes a third of the time. The search is made
    again with process noise only if that improves the penalised likelihood of the best set. Errors of rounding are no
    process noise.
    """
    found = search.run()
    if search.was_stopped or search.models.noise != MEASUREMENT or is_rounding(found.best):
        return search, found
    acting = attempted(lambda: search.models.with_process_noise(found.best), found.best, search.seconds_left)
    if not acting.criterion < found.best.criterion:
        return search, found
    other = LikelihoodSearch(search.models.with_noise(PROCESS), search.progress)
    if acting.names:
        other.models.calm = {**other.models.calm, acting.names: acting}
    return _ended(other, attempted(other.run, None, search.seconds_left)) or (search, found)


def _ended(search: LikelihoodSearch, found: Found | None) -> tuple[LikelihoodSearch, Found] | None:
    """Return a search with its result; None if it did not end."""
    return None if found is None or search.was_stopped else (search, found)


def least_error(search: LikelihoodSearch) -> tuple[LikelihoodSearch, Found] | None:
    """Search the same causes by least squares of free simulations; return None if time is up.

    Where a model is wrong, a likelihood with process noise or autoregressive measurement noise takes its error for
    noise. Least squares give the model that predicts best from the inputs alone (Ljung, System Identification,
    2nd ed., section 8.3). Causes are chosen by their predictions of trials left out. Where there are too few trials,
    they are those that bring a model near the data; where process noise acts, negligible errors are random.
    """
    if search.models.answered or search.was_stopped:
        return None
    other = LikelihoodSearch(search.models.least_squares, search.progress)

    def chosen() -> Found:
        if len(search.models.trials) < FEWEST:
            is_calm = search.models.noise == MEASUREMENT
            return other.settle(other.models.approach(0.0 if is_calm else NOTHING_PERCENT))
        return other.result(best_predicting(other, other.run().best.names))

    return _ended(other, attempted(chosen, None, search.seconds_left))


def found_with_white_process_noise(search: LikelihoodSearch, found: Found) -> LikelihoodFit | None:
    """Return the best set fitted with white process noise; None where no coloured process noise acts."""
    if search.was_stopped or not search.models.answered or not _has_coloured_noise(found.best):
        return None
    return attempted(lambda: with_white_process_noise(found.best), None, search.seconds_left)


def judged_again(search: LikelihoodSearch, found: Found, white: LikelihoodFit) -> tuple[LikelihoodSearch, Found] | None:
    """Return a search of the same causes with white process noise, and its result; None where that predicts no better.

    White noise is better where it lowers the error over the horizon by a thousandth of the nominal model's. Coloured
    process noise is itself predicted over its time constant, so that a cause which takes its place gains nothing there.
    No further cause is searched: the residual is coloured, and a likelihood of white noise would be too sure of
    differences between causes.

    Parameters
    ----------
    white
        The fit of `found_with_white_process_noise`.
    """

    def begun() -> LikelihoodModels | None:
        many = [[(f, found.best, f.trials)] for f in (found.nominal, found.best, white)]
        nominal, coloured, new = (squared_errors(one, search.models.horizon_s) for one in many)
        if not held_out_gain(nominal, coloured, new, search.models.seed).percent > NOTHING_PERCENT:
            return None
        return search.models.begun_with([white, *_parts_and_rivals(found)])

    sets = attempted(begun, None, search.seconds_left)
    if sets is None:
        return None
    again = LikelihoodSearch(sets, search.progress, Policy(given=white.names))
    return _ended(again, attempted(again.run, None, search.seconds_left))


def _parts_and_rivals(found: Found) -> list[LikelihoodFit]:
    """Return fits with white process noise of the subsets of the best set, and of the rivals equivalent to it."""
    parts = {f.names: f for f in (*found.without.values(), found.nominal)}
    parts |= {f.names: f for many in found.rivals.values() for f in not_excluded(found.best, many)}
    parts.pop(found.best.names, None)
    return in_parallel(with_white_process_noise, list(parts.values()))


def _has_coloured_noise(fitted: LikelihoodFit) -> bool:
    """Return whether coloured process noise acts on a rig whose initial states are unknown.

    Where the motion is imposed, the effort itself is read, with noise that may be as coloured. Where a rig begins at
    rest, autoregressive measurement noise is distinguished from process noise (`LikelihoodFits.nominal`).
    """
    is_coloured = any(fitted.noise.time[n] > step_s(fitted.noise, fitted.trials) for n in fitted.noise.acting)
    return is_coloured and all(t.kind != IMPOSED and fitted.model.rig.unknowns(t.kind) for t in fitted.trials)
