"""Other estimators of a rig than the likelihood: white process noise, and least squares of free simulations."""

from abc import abstractmethod

from fes_pin.data.schema import IMPOSED
from fes_pin.diagnosis.decide.by_prediction import FEWEST, best_predicting
from fes_pin.diagnosis.errors_ahead import squared_errors
from fes_pin.diagnosis.likelihood_models import Found, LikelihoodModels, LikelihoodSearch
from fes_pin.diagnosis.verdict import RigState, RigVerdict
from fes_pin.identify.likelihood_fit import LikelihoodFit, with_slow_process_noise, with_white_process_noise
from fes_pin.identify.process_noise import noise_limits, slowest_of_all, step_s
from fes_pin.infer.estimators import Estimator
from fes_pin.infer.held_out import held_out_gain
from fes_pin.infer.levels import NOTHING_PERCENT, SMALL_SHARE
from fes_pin.infer.search import Policy
from fes_pin.search.approach import approach
from fes_pin.search.likelihood_fits import MEASUREMENT
from fes_pin.workers import attempted, in_parallel

WHITE_PROCESS_NOISE = (
    "process noise is modelled as white: with coloured process noise the same model predicted worse over the horizon"
)
"""Warning where the estimator with white process noise is the answer."""


def _ended(search: LikelihoodSearch, found: Found | None) -> tuple[LikelihoodSearch, Found] | None:
    """Return a search with its result; None if it did not end."""
    return None if found is None or search.was_stopped else (search, found)


class RigEstimator(Estimator):
    """Another estimator of a rig, whose errors are those by which its causes are judged."""

    @abstractmethod
    def searched(self, first: RigState) -> tuple[LikelihoodSearch, Found] | None:
        """Return its search and the result of that; None where it does not apply or time is up."""

    def state(self, first: RigState) -> RigState | None:
        """Return the state of its own verdict."""
        if first.search.was_stopped or (found := self.searched(first)) is None:
            return None
        assert isinstance(first.verdict, RigVerdict)
        return first.verdict.of_search(found[0]).of(found[1], replaced=first)


class LeastSquares(RigEstimator):
    """Least squares of free simulations, for a rig in open loop whose model has a lack of fit.

    Where a model is wrong, a likelihood with process noise or autoregressive measurement noise takes its error for
    noise. Least squares give the model that predicts best from the inputs alone (Ljung, System Identification,
    2nd ed., section 8.3). Causes are chosen by their predictions of trials left out. Where there are too few trials,
    they are those that bring a model near the data; where process noise acts, negligible errors are random.
    """

    def searched(self, first: RigState) -> tuple[LikelihoodSearch, Found] | None:
        """Return a search of the same causes, and its result."""
        models, search = first.search.models, first.search
        if models.answered or not first.verdict.lack_of_fit(first).unexplained:
            return None
        other = LikelihoodSearch(models.least_squares, search.progress)

        def chosen() -> Found:
            if len(models.trials) < FEWEST:
                return other.settle(approach(other.models, 0.0 if models.noise == MEASUREMENT else NOTHING_PERCENT))
            return other.result(best_predicting(other, other.run().best.names))

        return _ended(other, attempted(chosen, None, search.seconds_left))


class SlowProcessNoise(RigEstimator):
    """Process noise as slow as all trials together tell, for a rig whose process noise is slower than one trial tells.

    A drift of the effort that differs from trial to trial is mistaken for a slow cause otherwise, as for a spring that
    relaxes. No further cause is searched.
    """

    prefers_smaller = True

    def searched(self, first: RigState) -> tuple[LikelihoodSearch, Found] | None:
        """Return a search of the same causes, and its result; None where no process noise is as slow as it may be."""
        found, search, models = first.found, first.search, first.search.models
        if not found.without or not _is_slow(found.best):
            return None
        fits = [found.nominal, found.best, *found.without.values()]
        slow = attempted(lambda: in_parallel(with_slow_process_noise, fits), None, search.seconds_left)
        if slow is None:
            return None
        again = LikelihoodSearch(models.begun_with(slow), search.progress, Policy(given=found.best.names))
        return _ended(again, attempted(again.run, None, search.seconds_left))


class WhiteProcessNoise(RigEstimator):
    """White process noise, for a rig in closed loop on which coloured process noise acts.

    White noise is better where it lowers the error over the horizon by a thousandth of the nominal model's. Coloured
    process noise is itself predicted over its time constant, so that a cause which takes its place gains nothing there.
    No further cause is searched: the residual is coloured, and a likelihood of white noise would be too sure of
    differences between causes.
    """

    fit: LikelihoodFit | None = None
    """The set of the first estimator, fitted with white process noise; None where no coloured process noise acts."""

    def searched(self, first: RigState) -> tuple[LikelihoodSearch, Found] | None:
        """Return a search of the same causes, and its result; None where the first set predicts no better."""
        found, search, models = first.found, first.search, first.search.models
        if not models.answered or not _has_coloured_noise(found.best):
            return None
        self.fit = white = attempted(lambda: with_white_process_noise(found.best), None, search.seconds_left)
        if white is None:
            return None

        def begun() -> LikelihoodModels | None:
            many = [[(f, found.best, f.trials)] for f in (found.nominal, found.best, white)]
            nominal, coloured, new = (squared_errors(one, models.horizon_s) for one in many)
            if not held_out_gain(nominal, coloured, new, models.seed).percent > NOTHING_PERCENT:
                return None
            return models.begun_with([white, *_parts_and_rivals(models, found)])

        sets = attempted(begun, None, search.seconds_left)
        if sets is None:
            return None
        again = LikelihoodSearch(sets, search.progress, Policy(given=white.names))
        return _ended(again, attempted(again.run, None, search.seconds_left))


def _parts_and_rivals(models: LikelihoodModels, found: Found) -> list[LikelihoodFit]:
    """Return fits with white process noise of the subsets of the best set, and of the rivals equivalent to it."""
    parts = {f.names: f for f in (*found.without.values(), found.nominal)}
    near = (models.equivalents(found.best, found.without[n], many) for n, many in found.rivals.items())
    parts |= {f.names: f for many in near for f in many}
    parts.pop(found.best.names, None)
    return in_parallel(with_white_process_noise, list(parts.values()))


def _is_slow(fitted: LikelihoodFit) -> bool:
    """Return whether a random process has the longest time constant of one trial, and all together tell a longer."""
    noise, most = fitted.noise, noise_limits(fitted.model, fitted.trials, fitted.noise)
    ends = [n for n in noise.acting if noise.time[n] > (1.0 - SMALL_SHARE) * most[f"time.{n}"][1]]
    return any(slowest_of_all(fitted.trials) > noise.time[n] for n in ends)


def _has_coloured_noise(fitted: LikelihoodFit) -> bool:
    """Return whether coloured process noise acts on a rig whose initial states are unknown.

    Where the motion is imposed, the effort itself is read, with noise that may be as coloured. Where a rig begins at
    rest, autoregressive measurement noise is distinguished from process noise (`LikelihoodFits.nominal`).
    """
    is_coloured = any(fitted.noise.time[n] > step_s(fitted.noise, fitted.trials) for n in fitted.noise.acting)
    return is_coloured and all(t.kind != IMPOSED and fitted.model.rig.unknowns(t.kind) for t in fitted.trials)
