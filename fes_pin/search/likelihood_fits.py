"""Fits of sets of causes by the likelihood, each with its process and measurement noise."""

import copy
import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Self

from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial
from fes_pin.identify.afar import at_a_bound, followed, following, misfit_percent, with_beliefs
from fes_pin.identify.ahead import default_horizon
from fes_pin.identify.correlation_time import with_new_noise
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit, at_noise, fit_of, maximise, maximum_from
from fes_pin.identify.process_noise import first_guess, stilled, without_memory
from fes_pin.infer.covariance import step_gain
from fes_pin.infer.fits import Candidate, FittedSets, Names
from fes_pin.infer.levels import FAR_PERCENT, NOTHING_PERCENT
from fes_pin.infer.maximise import ROUNDS
from fes_pin.infer.optimize import WORTH
from fes_pin.infer.optimum import minimise
from fes_pin.infer.problem import Unknowns, normal_equations
from fes_pin.infer.scoring import LITTLE
from fes_pin.infer.search import FITTED
from fes_pin.infer.text import WHOLE
from fes_pin.models.model import Model
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.models.stage import Effect
from fes_pin.search.approach import MORE, approach
from fes_pin.search.library import Library
from fes_pin.search.likelihood_maxima import less, likeliest, look, maximum_from_afar, process_noises
from fes_pin.search.possible import is_certain, is_possible
from fes_pin.search.score import Scored, best_by_effect
from fes_pin.search.starts import STARTED, STARTS, at_null, from_afar, refinements, started
from fes_pin.workers import in_parallel

FIRST_NOISE_SCALES = (1.0, 30.0)
"""Sizes of process noise at which the nominal fit starts, in units of the smallest. A likelihood can have two maxima:
in one the model explains the data, in the other process noise does. Where the process noise of a fit exceeds the larger
size, further causes are also started at the smallest."""
PROCESS, MEASUREMENT, WHITE = "process noise", "measurement noise", "white measurement noise"
"""Noise of the fits. Without process noise, predictions are free simulations; white measurement noise weighs every
error alike, as least squares do."""
ESTIMATORS = {
    PROCESS: f"likelihood with {PROCESS}",
    MEASUREMENT: f"likelihood with {MEASUREMENT} alone",
    WHITE: "least squares of free simulations",
}
"""The same as estimators, in words."""
RESTART_ROUNDS = 3
"""Alternations between parameters and noise in a fit that starts with little process noise."""
RESTART_SETS = 3
"""Sets that are fitted further from little process noise: those of lowest criterion after one alternation. Without that
alternation the best cause of a muscle, by 20 000 in twice the log-likelihood, was not among the first eight of
twenty."""


def first_noise(trials: Sequence[Trial], answered: bool) -> str:
    """Return the noise of the first fits to trials: with process noise in closed loop, and of imposed motion."""
    return PROCESS if answered or any(t.kind == IMPOSED for t in trials) else MEASUREMENT


Starts = list[Scored]
"""Shapes of a cause by which a set is extended, with their linear estimates, best first."""


class LikelihoodFits(FittedSets[LikelihoodFit, Starts]):
    """Fits of sets of causes to one set of trials, by the names of the causes; `()` is the nominal model.

    Parameters
    ----------
    model
        The nominal model with its start values.
    trials
        Measured trials.
    effects
        The causes that are searched; by default all that are known for the rig.
    answered
        Whether the rig is in closed loop; a property of the trials, not of the likelihood.
    seed
        Of critical values.
    horizon_s
        Horizon of errors, s; by default as `default_horizon` says.
    noise
        Noise of the fits: `PROCESS`, `MEASUREMENT` or `WHITE`.

    Attributes
    ----------
    fits
        Fits by names in alphabetical order.
    calm
        Fits of sets to the same trials without process noise, where there are any.
    proposed
        The set that another estimator found, with its values; None without one.
    library
        The causes, with their score tests.
    in_best_form
        Fits of which no other form is better.
    """

    def __init__(
        self,
        model: Model,
        trials: Sequence[Trial],
        effects: Sequence[type[Effect]] | None = None,
        answered: bool = True,
        seed: int = 0,
        horizon_s: float | None = None,
        noise: str = PROCESS,
    ) -> None:
        super().__init__()
        self.calm: dict[Names, LikelihoodFit] = {}
        self.proposed: Model | None = None
        self.model, self.trials, self.answered, self.noise = model, tuple(trials), answered, noise
        self.seed, self.horizon_s = seed, horizon_s or default_horizon(self.trials)
        if any(t.kind == IMPOSED for t in self.trials):  # imposed motion excites a rig most, and a muscle is several
            self.most_candidates = None
        self.library = Library(self.model, trials, effects, answered)
        self._calm: StateSpaceNoise | None = None
        self._following = None if answered else following(self.model, self.trials)
        self._followed: dict[Names, LikelihoodFit] = {}
        self._misfits: dict[int, tuple[LikelihoodFit, float]] = {}
        self._rough: Self | None = None
        self._compared: dict[tuple[Names, str], LikelihoodFit] = {}
        self.in_best_form: list[LikelihoodFit] = []

    @property
    def estimator(self) -> str:
        """How sets are fitted, in words."""
        known = self.fits[()].noise
        kind = "white " if known.timed else "slow " if known.slowest_s else ""
        return f"likelihood with {kind}{PROCESS}" if kind else ESTIMATORS[self.noise]

    @property
    def judged_s(self) -> float | None:
        """Horizon by which causes are judged, s: in closed loop or of imposed motion; None for free simulation.

        In closed loop errors come back as an input, and a free simulation of even the best model diverges.
        """
        return self.horizon_s if self.answered or any(t.kind == IMPOSED for t in self.trials) else None

    def begun_with(self, fits: Sequence[LikelihoodFit]) -> Self:
        """Return the same trials and causes with some fits to start from; the process noise is timed as in these."""
        other = copy.copy(self)
        other.fits, other.proposed = {f.names: f for f in fits}, None
        other._converged, other._begun, other._compared = set(), set(), {}
        return other

    def take_nominal(self, fitted: LikelihoodFit | None) -> None:
        """Begin with a fit, where it is that of the nominal model to the same samples, with process noise."""
        if fitted is None or self.model.effects or fitted.model.rig.fitted != self.model.rig.fitted:
            return
        if fitted.trials == self.trials:
            self.fits[()] = fitted

    def nominal(self) -> LikelihoodFit:
        """Fit the nominal model from several sizes of process noise; return the given fit where there is one."""
        if () in self.fits:
            return self.fits[()]
        from_rest = all(t.kind != IMPOSED and not self.model.rig.unknowns(t.kind) for t in self.trials)
        if from_rest or self.judged_s is None or self.noise == WHITE:
            self.fits[()] = self._without_process_noise_first()
        else:
            self.fits[()] = with_new_noise(self.trials, self._nominal)
        return self.fits[()]

    def _without_process_noise_first(self) -> LikelihoodFit:
        """Return the nominal fit without process noise, or with it if that improves the penalised likelihood."""
        guess = first_guess(self.model, self.trials)
        filtered = self.judged_s is not None
        none = stilled(self.model, self.trials, guess) if filtered else replace(guess, std={}, time={})
        calm = self.calm.get(()) or maximum_from_afar(self.model, self.trials, none)
        calm = calm if self.noise == WHITE or () in self.calm else self._coloured(calm)
        self._calm = calm.noise
        return min(calm, self.with_process_noise(calm), key=lambda f: f.criterion) if self.noise == PROCESS else calm

    def with_process_noise(self, calm: LikelihoodFit) -> LikelihoodFit:
        """Return a fit without process noise again with it, from the likeliest of several sizes of process noise."""
        begun = process_noises(calm, FIRST_NOISE_SCALES)
        if not begun:
            return calm
        if self.answered:
            found = in_parallel(lambda d: self._maximum(calm.model, d), begun)
            return self._with_orders(min(found, key=lambda f: f.sse))
        return self._with_orders(self._maximum(calm.model, likeliest(calm, begun)))

    def _with_orders(self, fitted: LikelihoodFit) -> LikelihoodFit:
        """Return a fit again, with autoregressive noise of the orders that its innovations support."""
        problem = LikelihoodProblem(fitted.model, self.trials, fitted.noise)
        noise = problem.with_orders(fitted.values, fitted.unknowns)
        return self._maximum(fitted.model, noise, fitted.unknowns)

    def _coloured(self, fitted: LikelihoodFit, rounds: int = ROUNDS) -> LikelihoodFit:
        """Return a fit by least squares again with autoregressive noise; where that leads away, with its values kept.

        Autoregressive noise takes up any slow error: far from the data its likelihood may be larger where a simulation
        is worse.
        """
        problem = LikelihoodProblem(fitted.model, self.trials, fitted.noise)
        problem.noise = problem.with_orders(fitted.values, fitted.unknowns)
        problem.renew(fitted.values, fitted.unknowns)
        found = self._maximum(fitted.model, problem.noise, fitted.unknowns, rounds)
        if self.misfit(found) > max(FAR_PERCENT, MORE * self.misfit(fitted)):
            return fit_of(problem, minimise(problem, fitted.values, fitted.unknowns, 0))
        return found

    def _maximum(
        self, model: Model, noise: StateSpaceNoise, unknowns: Unknowns | None = None, rounds: int = ROUNDS
    ) -> LikelihoodFit:
        """Return the maximum from the values of a model and start values of noise; see `maximise`."""
        return maximise(LikelihoodProblem(model, self.trials, noise), unknowns, rounds)

    def _nominal(self, correlation_s: float) -> LikelihoodFit:
        """Return the nominal fit at a correlation time of the measurement noise."""
        guess = first_guess(self.model, self.trials, correlation_s)
        starts = [replace(guess, std={n: k * v for n, v in guess.std.items()}) for k in FIRST_NOISE_SCALES]
        return min(in_parallel(lambda d: self._maximum(self.model, d), starts), key=lambda f: f.sse)

    def _guess(self) -> StateSpaceNoise:
        """Return start values with little process noise, or with none where measurement noise is autoregressive."""
        if self._calm is not None:
            return self._calm
        known = self.fits[()].noise
        guess = replace(first_guess(self.model, self.trials, known.correlation_s), slowest_s=known.slowest_s)
        return without_memory(guess, self.trials) if known.timed else guess

    def _has(self, names: Names, forms: frozenset[Hashable]) -> bool:
        """Return whether a set needs no other start; by least squares it is begun from each base, as minima differ."""
        return self.noise != WHITE and super()._has(names, forms)

    def candidates(self, base: LikelihoodFit) -> dict[str, Candidate[Starts]]:
        """Return the causes that a fit lacks and whose scores are finite, each with its shapes of largest score."""
        by_effect = best_by_effect(self.library.scores(self.scored_in(base)).scored)
        return {n: Candidate(many[0].gain, some) for n, many in by_effect.items() if (some := _of_much(many))}

    def begin(self, base: LikelihoodFit, starts: Mapping[Names, Starts]) -> dict[Names, LikelihoodFit]:
        """Return the best first fit of each set: at the noise of the base, with little process noise, and from afar."""
        if base.model.rig.fitted != self.model.rig.fitted:  # no parameter is held any more
            rig = replace(base.model.rig, fitted=self.model.rig.fitted)
            base = replace(base, model=Model(rig, base.model.effects))
        if self.is_far(base):
            return self._begin_far(base, starts)
        begun = {k: [base.model + started(s.effect, s.amplitudes) for s in many] for k, many in starts.items()}
        looks = in_parallel(lambda k: self._first_fits(base, starts[k], begun[k]), list(starts))
        restarted = self.calm or self._restarted({names: models[0] for names, models in begun.items()}, base)
        each = zip(begun, looks, strict=True)
        return {n: min((*fits, restarted.get(n, fits[0])), key=lambda f: f.criterion) for n, fits in each}

    def is_far(self, fitted: LikelihoodFit) -> bool:
        """Return whether a fit is far from the data: E of its free simulations is above `FAR_PERCENT`.

        By least squares it is far above `NOTHING_PERCENT`. A fit is far too if a nominal parameter ended at a bound.
        In closed loop no fit is far: a filter follows the data there. Errors of an imposed motion do not grow with
        time: a fit to it is far where it is worse than a constant.
        """
        if self.answered:
            return False
        most = NOTHING_PERCENT if self.noise == WHITE else FAR_PERCENT
        if all(t.kind == IMPOSED for t in self.trials):
            most = WHOLE
        return self.misfit(fitted) > most or bool(at_a_bound(fitted, self.model))

    def misfit(self, fitted: LikelihoodFit) -> float:
        """Return E of a fit's free simulations, percent; see `identify.afar`."""
        if (key := id(fitted)) not in self._misfits:  # held as long as it is known, so that no other has its id
            self._misfits[key] = fitted, misfit_percent(fitted)
        return self._misfits[key][1]

    def scored_in(self, base: LikelihoodFit) -> LikelihoodFit:
        """Return the fit in which causes are scored: the fit itself, or far from the data a filter that follows it."""
        return self._follow(base) if self._following is not None and self.is_far(base) else base

    def _follow(self, base: LikelihoodFit) -> LikelihoodFit:
        """Return the fit of the same causes by a filter that follows the data."""
        if base.names not in self._followed:
            begun = base.model if base.names else self.model
            self._followed[base.names] = self._first_followed([begun])
        return self._followed[base.names]

    def _first_followed(self, models: Sequence[Model]) -> LikelihoodFit:
        assert self._following is not None
        return followed(models, self.trials, self._following)

    @property
    def least_squares(self) -> Self:
        """The same trials and causes, fitted by least squares."""
        if self.noise == WHITE:
            return self
        if self._rough is None:
            self._rough = self.begun_with(())
            self._rough.noise, self._rough.calm, self._rough._calm = WHITE, {}, None
        return self._rough

    def first(self) -> Names:
        """Return the set that a search begins with: the proposed one, or one nearer to the data than the nominal model.

        A likelihood with autoregressive noise compares small deviations. Far from the data the noise takes up every
        error, and least squares compare.
        """
        if begun := self._from_proposed():
            return begun
        if self.noise == WHITE or not self.is_far(self.fits[()]):
            return ()
        best, rough = approach(self.least_squares), self.least_squares.fits
        for names in sorted((n for n in rough if n and set(n) <= set(best)), key=len):
            self.fits[names] = self._from_least_squares(rough[names])
        return best

    def _from_proposed(self) -> Names:
        """Return the proposed set, or the own best candidate if that is likelier; none without a proposal."""
        if self.proposed is None or not self.proposed.effects:
            return ()
        names = self.fit_model(self.proposed)
        if not math.isfinite(self.fits[names].criterion) or self.is_far(self.fits[names]):
            return ()
        self.extend((), FITTED)
        return min((names, self.ranked(1)[0]), key=lambda n: self.fits[n].criterion)

    def fit_model(self, model: Model) -> Names:
        """Fit a model from its values, in the form of its causes that is significant, and return its names."""
        if self.noise == PROCESS:
            fits = in_parallel(partial(self._maximum, model), [self.fits[()].noise, self._guess()])
        else:
            fits = [self.from_least_squares(model)]
        best = min(fits, key=lambda f: f.criterion)
        self.fits[best.names] = best
        self.converge_these([best.names])
        while (better := self.better_form(self.fits[best.names])) is not None:
            self.fits[best.names] = better
        return best.names

    def _begin_far(self, base: LikelihoodFit, starts: Mapping[Names, Starts]) -> dict[Names, LikelihoodFit]:
        """Return first fits of sets that extend one far from the data: by least squares, begun by a filter."""
        if self.noise == WHITE:
            fits = in_parallel(lambda n: self._first_far(base, n, starts[n]), list(starts))
        else:
            rough = self.least_squares
            rough.nominal()
            if base.names not in rough.fits:
                rough.fits[base.names] = rough._maximum(base.model, rough.fits[()].noise, base.unknowns)
            made = rough.begin(rough.fits[base.names], {k: s for k, s in starts.items() if k not in rough.fits})
            known = {**made, **rough.fits}
            fits = in_parallel(lambda n: self._from_least_squares(known[n]), list(starts))
        return dict(zip(starts, fits, strict=True))

    def _first_far(self, base: LikelihoodFit, names: Names, starts: Starts) -> LikelihoodFit:
        """Return the first fit of a set from its scores; from far sizes too where no descent from there leads on."""
        effects = [started(s.effect, s.amplitudes) for s in starts]
        found = self._looked_far(base, names, effects)
        if base.names and found.sse < base.sse - WORTH:
            return found
        far = from_afar(effects[0], self.library.measured)
        return min(found, self._looked_far(base, names, far), key=lambda f: f.criterion) if far else found

    def _looked_far(self, base: LikelihoodFit, names: Names, effects: Sequence[Effect]) -> LikelihoodFit:
        """Return the best first fit with one of some effects: from the base, and from the filter that follows it."""
        looks = [look(base.model + e, base) for e in effects]
        if self._following is not None:
            near = self._follow(base).model
            first = self._first_followed([near + e for e in effects])
            self._followed[names] = min(self._followed.get(names, first), first, key=lambda f: f.sse)
            looks.append(self._maximum(first.model, base.noise, first.unknowns, RESTART_ROUNDS))
        return min(looks, key=lambda f: f.criterion)

    def from_least_squares(self, model: Model) -> LikelihoodFit:
        """Return the fit of a model from its values, by least squares and then with the noise of these fits."""
        rough = self.least_squares
        return self._from_least_squares(rough._maximum(model, rough.nominal().noise))

    def _from_least_squares(self, fitted: LikelihoodFit) -> LikelihoodFit:
        """Return a fit by least squares again with the noise of these fits."""
        if self.noise == MEASUREMENT or not self.fits[()].noise.acting:
            return self._coloured(fitted, RESTART_ROUNDS)
        return self._maximum(fitted.model, self._guess(), fitted.unknowns, RESTART_ROUNDS)

    def _first_fits(self, base: LikelihoodFit, starts: Starts, models: Sequence[Model]) -> list[LikelihoodFit]:
        """Return first fits of a set; where all are worse than the base, also the one from next to its null."""
        looks, effect = [look(one, base) for one in models], starts[0].effect
        if all(f.sse > base.sse + WORTH for f in looks):
            looks.append(look(base.model + at_null(effect), base))
        return [*looks, *(self._elsewhere(effect) if not base.names else [])]

    def _elsewhere(self, effect: Effect) -> list[LikelihoodFit]:
        """Return fits of one cause alone from far sizes, with the start values of the nominal model.

        No descent from the null leads to such sizes: an effort of the wrong sign is found here or nowhere. By least
        squares fits start from each form of the cause too, since the nominal fit may be far from the fit of that form.
        """
        guess, measured = self._guess(), self.library.measured
        begun = [self.model + one for one in from_afar(effect, measured)]
        begun += refinements(self.model + effect, effect, measured) if self.noise == WHITE else []
        return in_parallel(lambda one: self._maximum(one, guess, rounds=RESTART_ROUNDS), begun)

    def _restarted(self, starts: Mapping[Names, Model], base: LikelihoodFit) -> dict[Names, LikelihoodFit]:
        """Return fits that start with little process noise, where that of the base takes what a cause should explain.

        All sets are fitted for one alternation; those of lowest criterion are fitted further.
        """
        guess, least = self._guess(), first_guess(self.model, self.trials, base.noise.correlation_s).std
        if all(base.noise.std[n] <= FIRST_NOISE_SCALES[-1] * least[n] for n in base.noise.acting):
            return {}
        first = in_parallel(lambda start: self._maximum(start, guess, rounds=1), list(starts.values()))
        lowest = sorted(zip(starts, first, strict=True), key=lambda one: one[1].criterion)[:RESTART_SETS]
        gone_on = in_parallel(lambda one: maximum_from(one[1], self.trials, rounds=RESTART_ROUNDS - 1), lowest)
        return {names: fitted for (names, _), fitted in zip(lowest, gone_on, strict=True)}

    def converged(self, fits: Sequence[LikelihoodFit]) -> list[LikelihoodFit]:
        """Return the converged fits, with nominal parameters that they do not identify as believed."""
        return in_parallel(lambda f: with_beliefs(maximum_from(f, self.trials), self.model), fits)

    def under_noise_of(self, other: LikelihoodFit, fits: Sequence[LikelihoodFit]) -> list[LikelihoodFit]:
        """Return fits, with their parameters, under the noise of another fit of the same trials."""
        return in_parallel(lambda f: at_noise(f, other.noise), fits)

    def converge_rivals(self, names: Names, name: str) -> None:
        """Converge the rivals of a candidate, which also begin at its place where they may have ended elsewhere.

        First fits of rivals extend the set without the candidate. From far off, or in another form, they may end
        elsewhere.
        """
        whole, rest = self.fits[names], tuple(n for n in names if n != name)
        is_far = self.is_far(self.fits[rest]) and not self.is_far(whole)
        others = [k for k in self.fits if len(k) == len(names) and set(rest) < set(k) and k != names]
        self.begin_at(whole, others if is_far else self.in_other_forms(whole, others))
        super().converge_rivals(names, name)

    def in_other_forms(self, whole: LikelihoodFit, sets: Sequence[Names]) -> list[Names]:
        """Return the sets in which a cause has another form than in a fit."""
        known = {k: frozenset(one for one in self.form_of(whole) if one[0] in k) for k in sets}
        return [k for k in sets if not known[k] <= self.form_of(self.fits[k])]

    def begin_at(self, whole: LikelihoodFit, sets: Sequence[Names]) -> None:
        """Fit sets again from a fit, and keep what is likelier: shared causes have its values, the others no effect."""

        def looked(names: Names) -> LikelihoodFit:
            shared = [e for e in whole.model.effects if e.name in names]
            model = Model(whole.model.rig, tuple(shared))
            for effect in self.fits[names].model.effects:
                if effect.name not in whole.names:
                    model += at_null(effect)
            return look(model, whole)

        looks = dict(zip(sets, in_parallel(looked, sets), strict=True))
        better = {k: f for k, f in looks.items() if f.criterion < self.fits[k].criterion}
        self.fits.update(better)
        self._converged -= set(better)

    def step_gain(self, fitted: LikelihoodFit) -> float:
        """Return the gain of a further step of a fit by its slope and curvature; 0 where it has converged."""
        if fitted.gradient_norm < LITTLE or not math.isfinite(fitted.sse):
            return 0.0
        return step_gain(normal_equations(fitted.parts), [n not in fitted.at_bound for n in fitted.free])

    def form_of(self, fitted: LikelihoodFit) -> frozenset[tuple[str, tuple[str, ...]]]:
        """Return for each cause of a fit its name and its refinements."""
        return frozenset((e.name, e.refined()) for e in fitted.model.effects)

    def without(self, names: Names, name: str) -> LikelihoodFit:
        """Return the fit of a set without one cause, from the values of the set where that is better."""
        rest, whole = tuple(n for n in names if n != name), self.fits[names]
        if self._compared.get((names, name)) is not whole:
            effect = next(e for e in whole.model.effects if e.name == name)
            begun = less(whole, effect.amplitudes(), effect)
            own = self._maximum(begun, whole.noise, whole.unknowns)
            if any(own.sse > f.sse + WORTH for f in self._parts(rest)):  # it diverged, or a subset explains more
                own = self._grown(rest, begun.effects)
            if rest not in self.fits or own.criterion < self.fits[rest].criterion:
                self.fits[rest] = own
            self._compared[names, name] = whole
        return self.fits[rest]

    def _parts(self, names: Names) -> list[LikelihoodFit]:
        """Return the fits of a set and of its subsets, best first."""
        return sorted((f for k, f in self.fits.items() if set(k) <= set(names)), key=lambda f: f.sse)

    def _grown(self, names: Names, effects: Sequence[Effect]) -> LikelihoodFit:
        """Return the fit of a set from the best fit of a subset, extended by one effect after another.

        Each effect starts at its null, in its own form.
        """
        fitted = self._parts(names)[0]
        for one in effects:
            if one.name not in {e.name for e in fitted.model.effects}:
                fitted = self._maximum(fitted.model + at_null(one), fitted.noise, fitted.unknowns)
        return fitted

    def is_possible(self, fitted: LikelihoodFit) -> bool:
        """Return False if a fit is no model, or the size of a cause is impossible; see `possible.is_possible`."""
        return self.is_a_model(fitted) and is_possible(fitted, self.library.measured)

    def is_a_model(self, fitted: LikelihoodFit) -> bool:
        """Return whether a fit is better than a constant, with every nominal parameter off its bounds."""
        worse = self.judged_s is None and self.misfit(fitted) > WHOLE
        return not (worse or at_a_bound(fitted, self.model))

    def is_certain(self, fitted: LikelihoodFit, name: str) -> bool:
        """See `possible.is_certain`."""
        return is_certain(fitted, next(e for e in fitted.model.effects if e.name == name))


def _of_much(shapes: Sequence[Scored]) -> list[Scored]:
    """Return the shapes of a cause of largest score."""
    return [s for s in shapes[:STARTS] if s.gain >= STARTED * shapes[0].gain]
