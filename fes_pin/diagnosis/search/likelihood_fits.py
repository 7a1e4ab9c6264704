"""Sets of causes, each fitted with everything that is random about the rig: one score for a set, whatever led to it."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Self

from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.search.cause_sets import Names, names_of
from fes_pin.diagnosis.search.library import Library
from fes_pin.diagnosis.search.likelihood_forms import LikelihoodForms
from fes_pin.diagnosis.search.likelihood_maxima import LikelihoodMaxima
from fes_pin.diagnosis.search.likelihood_screen import LikelihoodScreen
from fes_pin.diagnosis.search.possible import is_possible
from fes_pin.diagnosis.search.score import Scored, best_by_effect
from fes_pin.diagnosis.search.starts import STARTS, from_afar, started
from fes_pin.identify.covariance import step_gain
from fes_pin.identify.doubts import first_guess, stilled
from fes_pin.identify.fit import Fit
from fes_pin.identify.fresh_efforts import fresh
from fes_pin.identify.lasting import with_new_noise
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.problem import normal_equations
from fes_pin.identify.scoring import LITTLE, WORTH
from fes_pin.infer.levels import SEPARABLE
from fes_pin.models.model import Model
from fes_pin.models.predictor import Doubt
from fes_pin.models.stage import Effect
from fes_pin.workers import in_parallel

CONVERGED_SETS = 4
"""Best sets of a size that go on until they converge."""
FIRST_DOUBTS = (1.0, 30.0)
"""Sizes of random effort that the nominal fit begins with, in units of the smallest: a likelihood can have two optima,
one in which the model explains and one in which randomness does. Beside a fit whose random effort is beyond the larger,
further causes begin also with the smallest."""
AFRESH_ROUNDS = 3
"""Turns of parameters and randomness of such a fit, before the best sets converge."""
AFRESH_SETS = 3
"""Sets that go on from little randomness: the lowest of all that begin there, once what is random has had a turn.
Before, a muscle's best cause, by 20 000 in twice the log-likelihood, was not among the first eight of twenty."""

_Refined = tuple[tuple[str, tuple[str, ...]], ...]
"""Of each cause of a set its name, and which refinements it has."""


class LikelihoodFits:
    """Fits of sets of causes to one set of trials, by the names of the causes; `()` is the nominal model.

    Parameters
    ----------
    model
        The nominal model with its start values.
    trials
        What was measured.
    effects
        The causes that are looked for; by default all that are known of the rig.
    answered
        Whether an effort, if there is one, answers what is read; a property of the trials, not of the likelihood.

    Attributes
    ----------
    fits
        By names in alphabetical order.
    screen
        What every cause promises beside a fit.
    forms
        Other forms of a set that is fitted.
    """

    def __init__(
        self,
        model: Model,
        trials: Sequence[Trial],
        effects: Sequence[type[Effect]] | None = None,
        answered: bool = True,
    ) -> None:
        self.model, self.trials = Model(model.rig), tuple(trials)
        self.library = Library(self.model, trials, effects, answered)
        self.fits: dict[Names, Fit] = {}
        self._calm: Doubt | None = None
        self._converged: set[Names] = set()
        self._begun: set[tuple[Names, _Refined]] = set()
        self._compared: dict[tuple[Names, str], Fit] = {}
        self._maxima = LikelihoodMaxima(trials)
        self.screen = LikelihoodScreen(self.library)
        self.forms = LikelihoodForms(self._maxima, self.library.measured)

    def begun_with(self, fits: Sequence[Fit]) -> Self:
        """The same trials and causes, with some fits to begin with; what is random is timed as in them."""
        other = copy.copy(self)
        other.fits = {names_of(f): f for f in fits}
        other._converged, other._begun, other._compared = set(), set(), {}
        return other

    def nominal(self) -> Fit:
        """Fit the nominal model, from several sizes of what is random; as it is where the fits began with one."""
        if () in self.fits:
            return self.fits[()]
        from_rest = all(t.kind != IMPOSED and not self.model.rig.unknowns(t.kind) for t in self.trials)
        self.fits[()] = self._from_rest() if from_rest else with_new_noise(self.trials, self._nominal)
        return self.fits[()]

    def _from_rest(self) -> Fit:
        """The nominal fit under noise that foretells itself; with a random effort besides, if that earns its price."""
        guess = first_guess(self.model, self.trials)
        calm = self._with_orders(self._maxima.from_start(self.model, stilled(self.model, self.trials, guess)))
        assert calm.doubt is not None
        self._calm = calm.doubt
        if not guess.std:
            return calm
        white = {n: (0.0,) * len(own) for n, own in calm.doubt.ar.items()}
        begun = [replace(calm.doubt, std=guess.std, still=())]
        begun += [replace(guess, std={n: k * v for n, v in guess.std.items()}, ar=white) for k in FIRST_DOUBTS]
        found = in_parallel(lambda d: self._maxima.from_start(calm.model, d), begun)
        return min(calm, self._with_orders(min(found, key=lambda f: f.sse)), key=lambda f: f.price)

    def _with_orders(self, fitted: Fit) -> Fit:
        """A fit again, with autoregressions of the orders that what its filter leaves shows."""
        assert fitted.doubt is not None
        problem = LikelihoodProblem(fitted.model, self.trials, fitted.doubt)
        doubt = problem.with_orders(fitted.values, fitted.unknowns)
        return self._maxima.from_start(fitted.model, doubt, fitted.unknowns)

    def _nominal(self, lasts_s: float) -> Fit:
        """The nominal fit where the noise of a reading lasts so long."""
        guess = first_guess(self.model, self.trials, lasts_s)
        starts = [replace(guess, std={n: k * v for n, v in guess.std.items()}) for k in FIRST_DOUBTS]
        return min(in_parallel(lambda d: self._maxima.from_start(self.model, d), starts), key=lambda f: f.sse)

    def _guess(self) -> Doubt:
        """Little that is random, or nothing where noise foretells itself, with noise that lasts as it does."""
        if self._calm is not None:
            return self._calm
        known = self.fits[()].doubt
        guess = first_guess(self.model, self.trials, known.lasts_s if known else 0.0)
        return fresh(guess, self.trials) if known and known.timed else guess

    def _begin(self, base: Fit, scored: Sequence[Scored]) -> tuple[Model, list[Fit]]:
        """Begin a base with one more effect, from its shapes of largest score: the start, and first fits from there."""
        worth = [s for s in scored[:STARTS] if s.gain >= 0.5 * scored[0].gain]
        starts = [base.model + started(s.probe.effect, s.amplitudes) for s in worth]
        others = [] if base.model.effects else self._elsewhere(worth[0].probe.effect)
        return starts[0], [*(self._maxima.look(s, base) for s in starts), *others]

    def _elsewhere(self, effect: Effect) -> list[Fit]:
        """Fits from sizes of a cause that no line from its null leads to, beside the rig as it was believed.

        Beside nothing alone: an effort with the wrong sign shows there, or nowhere.
        """
        guess = self._guess()
        begun = [self.model + one for one in from_afar(effect, self.library.measured)]
        return [self._maxima.from_start(one, guess, rounds=AFRESH_ROUNDS) for one in begun]

    def extend_with_both(self, base: Fit, pair: tuple[Scored, Scored]) -> tuple[Model, list[Fit]]:
        """Begin a base with two more effects at once, from their linear estimates."""
        model = base.model
        for one in pair:
            model = model + started(one.probe.effect, one.amplitudes)
        return model, [self._maxima.look(model, base)]

    def add(self, base: Fit, made: Mapping[Names, Callable[[], tuple[Model, list[Fit]]]]) -> None:
        """Fit sets that extend a base side by side; of several fits of a set the best stays."""
        begun = dict(zip(made, in_parallel(lambda make: make(), made.values()), strict=True))
        afresh = self._afresh({names: start for names, (start, _) in begun.items()}, base)
        for names, (_, fits) in begun.items():
            best = min((*fits, *afresh.get(names, ())), key=lambda f: f.price)
            if names not in self.fits or best.price < self.fits[names].price:
                self.fits[names] = best
                self._converged.discard(names)
        for size in sorted({len(n) for n in made}):
            self.converge(size)

    def _afresh(self, starts: Mapping[Names, Model], base: Fit) -> dict[Names, list[Fit]]:
        """Fits that begin with little that is random, where another's random effort takes what a model should.

        All take a turn there; those that explain most then go on.
        """
        assert base.doubt is not None
        guess = self._guess()
        if all(n in base.doubt.still or base.doubt.std[n] <= FIRST_DOUBTS[-1] * v for n, v in guess.std.items()):
            return {}
        first = in_parallel(lambda start: self._maxima.from_start(start, guess, rounds=1), list(starts.values()))
        lowest = sorted(zip(starts, first, strict=True), key=lambda one: one[1].price)[:AFRESH_SETS]
        gone_on = in_parallel(lambda one: self._maxima.go_on(one[1], AFRESH_ROUNDS - 1), lowest)
        return {names: [fitted] for (names, _), fitted in zip(lowest, gone_on, strict=True)}

    def converge(self, size: int, without: Sequence[Names] = ()) -> None:
        """Let the best of a size converge, and what is half way there: equivalents of one cause are no others.

        Parameters
        ----------
        without
            Sets that are not asked for.
        """
        while slow := [n for n in self._hopeful(size, without) if n not in self._converged]:
            self._go_on(slow)

    def _go_on(self, slow: Sequence[Names]) -> None:
        """Let sets go on until they converge."""
        self.fits.update(zip(slow, in_parallel(lambda n: self._maxima.go_on(self.fits[n]), slow), strict=True))
        self._converged.update(slow)

    def converge_rivals(self, base: Names, name: str) -> None:
        """Let sets converge that hold another cause beside a base, where slopes promise as much of it.

        A spring fell short by 37 of the constant torque that it can be, for its fit had ended on the way.
        """
        promised = {n: many[0].gain for n, many in best_by_effect(self.screen.scores(self.fits[base]).scored).items()}
        least = promised.get(name, math.inf) - SEPARABLE
        rivals = [tuple(sorted((*base, n))) for n, gain in promised.items() if gain > least]
        self._go_on([n for n in rivals if n in self.fits and n not in self._converged])

    def _hopeful(self, size: int, without: Sequence[Names]) -> list[Names]:
        """The sets of a size that promise to be the best, and those that come near the best."""
        near, ranked = self.near(size, without), [n for n in self.ranked(size) if n not in without]
        first = sorted(ranked, key=lambda n: self.fits[n].price - self._promised(n))[:CONVERGED_SETS]
        return [n for n in ranked if n in first or n in near]

    def _promised(self, names: Names) -> float:
        """What a further step from where a fit of a set has come to promises; 0 where it has converged."""
        fitted = self.fits[names]
        if names in self._converged or fitted.gradient_norm < LITTLE or not math.isfinite(fitted.sse):
            return 0.0
        return step_gain(normal_equations(fitted.parts), [n not in fitted.at_bound for n in fitted.free])

    def near(self, size: int, without: Sequence[Names] = ()) -> list[Names]:
        """Sets of a size that gain half of what the best does beside the best smaller one, best first; the best."""
        ranked = [n for n in self.ranked(size) if n not in without]
        if not ranked:
            return []
        smaller = self.fits[self.ranked(size - 1)[0]].price if size else math.inf
        half = 0.5 * (smaller + self.fits[ranked[0]].price)
        return [n for n in ranked if n == ranked[0] or self.fits[n].price < half]

    def extend(self, base: Names, most: int | None = None) -> list[Names]:
        """Fit a set with each further cause beside it, or with those of largest score; returns their names.

        Those that are fitted begin once more where the causes of the base have another form in them: it may have had
        another, and each begins with that of its base.
        """
        fitted = self.fits[base]
        by_effect = best_by_effect(self.screen.scores(fitted).scored)
        chosen = sorted(by_effect, key=lambda n: (-by_effect[n][0].gain, n))[:most]
        keys = {tuple(sorted((*base, n))): by_effect[n] for n in chosen}
        form = _form(fitted)
        missing = {k: v for k, v in keys.items() if (k, form) not in self._begun and not self._has(k, form)}
        self._begun.update((k, form) for k in missing)
        self.add(fitted, {k: lambda v=v: self._begin(fitted, v) for k, v in missing.items()})  # type: ignore[misc]
        return list(keys)

    def _has(self, names: Names, form: _Refined) -> bool:
        """Whether a set is fitted with some causes in a form."""
        return names in self.fits and set(form) <= set(_form(self.fits[names]))

    def without(self, names: Names, name: str) -> Fit:
        """The fit of a set less one cause, from the set's own values where that is better."""
        rest, whole = tuple(n for n in names if n != name), self.fits[names]
        if self._compared.get((names, name)) is not whole:
            assert whole.doubt is not None
            effect = next(e for e in whole.model.effects if e.name == name)
            begun = self._maxima.less(whole, effect.amplitudes(), effect)
            own = self._maxima.from_start(begun, whole.doubt, whole.unknowns)
            if any(own.sse > f.sse + WORTH for f in self._parts(rest)):  # it ran away, or a part of it explains more
                own = self._grown(rest, begun.effects)
            if rest not in self.fits or own.price < self.fits[rest].price:
                self.fits[rest] = own
            self._compared[names, name] = whole
        return self.fits[rest]

    def _parts(self, names: Names) -> list[Fit]:
        """The fits of a set and of its parts, best first."""
        return sorted((f for k, f in self.fits.items() if set(k) <= set(names)), key=lambda f: f.sse)

    def _grown(self, names: Names, effects: Sequence[Effect]) -> Fit:
        """The fit of a set from the best fit of a part of it, with one more of its effects after another.

        Each begins at nothing, in its own form.
        """
        fitted = self._parts(names)[0]
        for one in effects:
            if one.name not in names_of(fitted):
                assert fitted.doubt is not None
                nothing = {n: float(one.parameters()[n].null) for n in one.amplitudes()}  # type: ignore[arg-type]
                fitted = self._maxima.from_start(fitted.model + started(one, nothing), fitted.doubt, fitted.unknowns)
        return fitted

    def is_possible(self, fitted: Fit) -> bool:
        """False if the size of a cause is nothing that it can be; see `possible.is_possible`."""
        return is_possible(fitted, self.library.measured)

    def ranked(self, size: int) -> list[Names]:
        """Sets of a size, cheapest first; those that have converged to what cannot be come last."""
        absurd = {n for n in self._converged if not self.is_possible(self.fits[n])}
        return sorted((n for n in self.fits if len(n) == size), key=lambda n: (n in absurd, self.fits[n].price, n))


def _form(fitted: Fit) -> _Refined:
    return tuple((e.name, e.refined()) for e in fitted.model.effects)
