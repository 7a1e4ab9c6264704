"""Sets of causes, each fitted with everything that is random about the rig: one score for a set, whatever led to it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.diagnose.search.cause_sets import Names, names_of
from fes_pin.diagnose.search.library import Library, Probe
from fes_pin.diagnose.search.refined_forms import is_identified
from fes_pin.diagnose.search.score import Projection, Scored, Scores, best_by_effect
from fes_pin.diagnose.search.starts import STARTS, begun_anew, far_sizes, refinements, started
from fes_pin.identify.covariance import moved_with
from fes_pin.identify.doubts import first_guess
from fes_pin.identify.fit import PARAMETER_PRICE, Fit, fit_problem
from fes_pin.identify.lasting import with_new_noise
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.problem import limits_of
from fes_pin.identify.scoring import WORTH
from fes_pin.identify.turns import ROUNDS, maximise
from fes_pin.models.model import Model
from fes_pin.models.predictor import Doubt
from fes_pin.models.stage import Effect
from fes_pin.workers import in_parallel

SCREEN_ITERATIONS = 4
"""Steps of a first fit of a set, at what is random in a smaller one."""
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
    """

    def __init__(self, model: Model, trials: Sequence[Trial], effects: Sequence[type[Effect]] | None = None) -> None:
        self.model, self.trials = Model(model.rig), tuple(trials)
        self.library = Library(self.model, trials, effects)
        self.fits: dict[Names, Fit] = {}
        self._scores: dict[int, tuple[Fit, Scores]] = {}
        self._converged: set[Names] = set()
        self._compared: dict[tuple[Names, str], Fit] = {}
        self._probing: dict[tuple, LikelihoodProblem] = {}

    def nominal(self) -> Fit:
        """Fit the nominal model, from several sizes of what is random."""
        self.fits[()] = with_new_noise(self.trials, self._nominal)
        return self.fits[()]

    def _nominal(self, lasts_s: float) -> Fit:
        """The nominal fit where the noise of a reading lasts so long."""
        guess = first_guess(self.model, self.trials, lasts_s)
        starts = [replace(guess, std={n: k * v for n, v in guess.std.items()}) for k in FIRST_DOUBTS]
        return min(in_parallel(lambda d: self._maximised(self.model, d), starts), key=lambda f: f.sse)

    def _guess(self) -> Doubt:
        """Little that is random, with noise that lasts as it does."""
        known = self.fits[()].doubt
        return first_guess(self.model, self.trials, known.lasts_s if known else 0.0)

    def _maximised(
        self, model: Model, doubt: Doubt, unknowns: list[dict[str, float]] | None = None, rounds: int = ROUNDS
    ) -> Fit:
        return maximise(LikelihoodProblem(model, self.trials, doubt), model.parameters(), unknowns, rounds)

    def _go_on(self, fitted: Fit, rounds: int = ROUNDS) -> Fit:
        assert fitted.doubt is not None
        return self._maximised(fitted.model, fitted.doubt, fitted.unknowns, rounds)

    def scores(self, base: Fit) -> Scores:
        """Promise of every effect that a fit does not have, at what is random in it; none beside one that runs away."""
        if not math.isfinite(base.sse):
            return Scores([], np.zeros((0, 0)), np.zeros(0), [])
        if id(base) not in self._scores:
            wanted = [e for e in self.library.effects if e.name not in names_of(base) and self.library.felt(e)]
            groups = in_parallel(lambda e: self._probes(e, base), wanted)
            self._scores[id(base)] = (base, Projection(base.parts).score([p for g in groups for p in g]))
        return self._scores[id(base)][1]

    def _probes(self, effect: type[Effect], base: Fit) -> list[Probe]:
        """The effect with every choice of its shapes beside the nominal parameters of a fit.

        Causes that the fit has are left out, but those that the effect shows beside: the predictor follows what was
        measured with them or without.
        """
        nominal = Model(base.model.rig, tuple(e for e in base.model.effects if e.name in effect.beside))
        assert base.doubt is not None
        out = []
        for one in self.library.grid(effect):
            key = (*(nominal + one).structure(), *(nominal + one).unused_parameters().items())
            if key not in self._probing:  # its columns are those of a fit, which shares the program
                self._probing[key] = LikelihoodProblem(nominal + one, self.trials, base.doubt)
            problem = self._probing[key]
            places = [problem.free.index(f"{effect.name}.{n}") for n in effect.amplitudes()]
            problem.doubt = base.doubt
            parts = problem.linearize((nominal + one).parameters(), problem.start_unknowns())
            out.append(Probe(one, np.nan_to_num(np.concatenate([p.jacobian[:, places] for p in parts]))))
        return out

    def extend(self, base: Fit, scored: Sequence[Scored]) -> tuple[Model, list[Fit]]:
        """Begin a base with one more effect, from its shapes of largest score: the start, and first fits from there."""
        worth = [s for s in scored[:STARTS] if s.gain >= 0.5 * scored[0].gain]
        starts = [base.model + started(s.probe.effect, s.amplitudes) for s in worth]
        others = [] if base.model.effects else self._elsewhere(worth[0].probe.effect)
        return starts[0], [*(self._first_fit(s, base) for s in starts), *others]

    def _elsewhere(self, effect: Effect) -> list[Fit]:
        """Fits from sizes of a cause that no line from its null leads to, beside the rig as it was believed.

        Beside nothing alone: an effort with the wrong sign shows there, or nowhere.
        """
        guess = self._guess()
        return [self._maximised(self.model + one, guess, rounds=AFRESH_ROUNDS) for one in far_sizes(effect)]

    def extend_with_both(self, base: Fit, pair: tuple[Scored, Scored]) -> tuple[Model, list[Fit]]:
        """Begin a base with two more effects at once, from their linear estimates."""
        model = base.model
        for one in pair:
            model = model + started(one.probe.effect, one.amplitudes)
        return model, [self._first_fit(model, base)]

    def add(self, base: Fit, made: Mapping[Names, Callable[[], tuple[Model, list[Fit]]]]) -> None:
        """Fit sets that extend a base side by side; of several fits of a set the best stays."""
        begun = dict(zip(made, in_parallel(lambda make: make(), made.values()), strict=True))
        afresh = self._afresh({names: start for names, (start, _) in begun.items()}, base)
        for names, (_, fits) in begun.items():
            best = min((*fits, *afresh.get(names, ())), key=lambda f: f.price)
            if names not in self.fits or best.price < self.fits[names].price:
                self.fits[names] = best
        for size in sorted({len(n) for n in made}):
            self._converge(size)

    def _afresh(self, starts: Mapping[Names, Model], base: Fit) -> dict[Names, list[Fit]]:
        """Fits that begin with little that is random, where another's random effort takes what a model should.

        All take a turn there; those that explain most then go on.
        """
        assert base.doubt is not None
        guess = self._guess()
        if all(base.doubt.std[n] <= FIRST_DOUBTS[-1] * small for n, small in guess.std.items()):
            return {}
        first = in_parallel(lambda start: self._maximised(start, guess, rounds=1), list(starts.values()))
        lowest = sorted(zip(starts, first, strict=True), key=lambda one: one[1].sse)[:AFRESH_SETS]
        gone_on = in_parallel(lambda one: self._go_on(one[1], AFRESH_ROUNDS - 1), lowest)
        return {names: [fitted] for (names, _), fitted in zip(lowest, gone_on, strict=True)}

    def _converge(self, size: int) -> None:
        """Let the best of a size converge, and what is half way there: equivalents of one cause are no others."""
        while slow := [n for n in self._hopeful(size) if n not in self._converged]:
            self.fits.update(zip(slow, in_parallel(lambda n: self._go_on(self.fits[n]), slow), strict=True))
            self._converged.update(slow)

    def _hopeful(self, size: int) -> list[Names]:
        """The best sets of a size, and those that come near the best."""
        near = set(self.near(size))
        return [n for k, n in enumerate(self.ranked(size)) if k < CONVERGED_SETS or n in near]

    def near(self, size: int) -> list[Names]:
        """Sets of a size that gain half of what the best does beside the best smaller one, best first; the best."""
        ranked = self.ranked(size)
        smaller = self.fits[self.ranked(size - 1)[0]].price if size else math.inf
        half = 0.5 * (smaller + self.fits[ranked[0]].price)
        return [n for n in ranked if n == ranked[0] or self.fits[n].price < half]

    def extend_all(self, base: Names, most: int | None = None) -> list[Names]:
        """Fit a set with each further cause beside it, or with those of largest score; returns their names."""
        fitted = self.fits[base]
        by_effect = best_by_effect(self.scores(fitted).scored)
        chosen = sorted(by_effect, key=lambda n: (-by_effect[n][0].gain, n))[:most]
        keys = {tuple(sorted((*base, n))): by_effect[n] for n in chosen}
        missing = {k: v for k, v in keys.items() if k not in self.fits}
        self.add(fitted, {k: lambda v=v: self.extend(fitted, v) for k, v in missing.items()})  # type: ignore[misc]
        return list(keys)

    def without(self, names: Names, name: str) -> Fit:
        """The fit of a set less one cause, from the set's own values where that is better."""
        rest, whole = tuple(n for n in names if n != name), self.fits[names]
        if self._compared.get((names, name)) is not whole:
            assert whole.doubt is not None
            effect = next(e for e in whole.model.effects if e.name == name)
            begun = self._less(whole, effect.amplitudes(), effect)
            own = self._maximised(begun, whole.doubt, whole.unknowns)
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
                fitted = self._maximised(fitted.model + started(one, nothing), fitted.doubt, fitted.unknowns)
        return fitted

    def _less(self, whole: Fit, gone: Sequence[str], effect: Effect) -> Model:
        """The model of a fit with some parameters of an effect at their nulls; without the effect if these are all.

        The others are where the fit's covariance takes them, or where they were: whichever is likelier. An effort's
        gain stands for an inertia that is another without it.
        """
        info, shared = effect.parameters(), [n for n in gone if n in effect.common()]
        nulls = {f"{effect.name}.{n}": float(info[n].null) for n in shared}  # type: ignore[arg-type]
        moving = [n for n in nulls if n in whole.free]
        here = np.array([whole.values[n] for n in whole.free])
        change = np.array([nulls[n] - whole.values[n] for n in moving])
        there = here + moved_with(whole.covariance, [whole.free.index(n) for n in moving], change)
        limits = limits_of(whole.model, self.trials)
        values = {n: float(np.clip(v, *limits[n])) for n, v in zip(whole.free, there, strict=True)}
        off = whole.model.with_parameters(nulls)
        left = off - effect.name if set(gone) >= set(effect.amplitudes()) else off
        assert whole.doubt is not None
        problem = LikelihoodProblem(left, self.trials, whole.doubt)
        unknowns = problem.completed(whole.unknowns)
        moved = left.with_parameters({n: v for n, v in values.items() if n in left.parameters()})
        costs = problem.bounds([(one.parameters(), unknowns) for one in (left, moved)])
        return moved if costs[1] < costs[0] else left

    def refined(self, names: Names, demanded: float) -> Fit | None:
        """The best fit of a set with the form of one of its effects refined; None where no form is, or none is told.

        Parameters
        ----------
        demanded
            Fall of twice the negative log-likelihood below which no refinement is adopted. What is not half way there
            once its parameters were fitted, beside randomness as it was, is not gone on with.
        """
        base = self.fits[names]
        starts = [s for effect in base.model.effects for s in refinements(base.model, effect, self.library.measured)]
        looks = sorted(in_parallel(lambda s: self._first_fit(s, base), starts), key=lambda f: f.price)
        worth = [f for f in looks[:STARTS] if base.sse - f.sse > 0.5 * max(demanded, base.sse - looks[0].sse)]
        found = [f for f in in_parallel(self._go_on, worth) if is_identified(f, base)]
        return min(found, key=lambda f: f.price, default=None)

    def simplified(self, names: Names) -> Fit | None:
        """The best fit of a set with one refinement of a form fewer; None where none is cheaper.

        A form that was demanded beside fewer causes may have stood for one that has been found since.
        """
        base = self.fits[names]
        both = ((e, n) for e in base.model.effects for n, *_ in e.refinements() if n in e.refined())
        starts = in_parallel(lambda one: self._less(base, one[1:], one[0]), list(both))
        return self._cheaper(starts, base, base.price)

    def reformed(self, names: Names) -> Fit | None:
        """A set with several refinements of a form, all begun anew at once; None where that is no better.

        They were adopted one after another, and the first may have bent to what a later one says.
        """
        base = self.fits[names]
        starts = [s for effect in base.model.effects for s in begun_anew(base.model, effect, self.library.measured)]
        return self._cheaper(starts, base, base.price - WORTH)

    def _cheaper(self, starts: Sequence[Model], base: Fit, price: float) -> Fit | None:
        """The best fit from some starts; None where none is below a price.

        Those that look best go on, if what they cost beside randomness as it was is within a parameter's price.
        """
        looks = sorted(in_parallel(lambda s: self._first_fit(s, base), starts), key=lambda f: f.price)
        worth = [f for f in looks[:STARTS] if f.price < base.price + PARAMETER_PRICE]
        best = min(in_parallel(self._go_on, worth), key=lambda f: f.price, default=None)
        return best if best is not None and best.price < price else None

    def _first_fit(self, start: Model, base: Fit) -> Fit:
        """A few steps from a start, at what is random in another fit."""
        assert base.doubt is not None
        problem = LikelihoodProblem(start, self.trials, base.doubt)
        found = fit_problem(problem, start.parameters(), base.unknowns, SCREEN_ITERATIONS)  # type: ignore[arg-type]
        return replace(found, doubt=base.doubt)

    def ranked(self, size: int) -> list[Names]:
        """Sets of a size, cheapest first; those that have converged to what cannot be come last."""
        absurd = {n for n in self._converged if not is_possible(self.fits[n])}
        return sorted((n for n in self.fits if len(n) == size), key=lambda n: (n in absurd, self.fits[n].price, n))


def is_possible(fitted: Fit) -> bool:
    """False if the size of a cause ended where what it can be ends, other than at nothing: it stands for another."""
    for effect in fitted.model.effects:
        info = effect.parameters()
        for n in effect.amplitudes():
            if f"{effect.name}.{n}" in fitted.at_bound and getattr(effect, n) != info[n].null:
                return False
    return True
