"""Fits of grouped models: one set of items on the trials of all groups."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from fes_pin.contrasts.grouped import Grouped, GroupedModel, GroupedProblem, Item, Weight, noise_in
from fes_pin.contrasts.promises import Bench, Promise, promises
from fes_pin.contrasts.repeats import Repeats, scatter, without_locals, without_scatter
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.search.library import Library
from fes_pin.diagnosis.search.score import Scores
from fes_pin.diagnosis.search.starts import STARTS, forms_beside, refinements
from fes_pin.identify.doubts import first_guess
from fes_pin.identify.fit import Fit, ended, fit_multistart, fit_problem, noise_of, rough_noise
from fes_pin.identify.lasting import with_new_noise
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit, fit_of, maximise
from fes_pin.identify.noise_floor import rich_noise
from fes_pin.identify.problem import Problem
from fes_pin.infer.distributions import chi2_quantile, chi2_tail
from fes_pin.infer.levels import DRIVEN_LEVEL
from fes_pin.infer.maximise import alternate
from fes_pin.infer.noise import Noise, NoiseModel, as_white
from fes_pin.infer.optimum import MAX_ITERATIONS, Optimum, minimise
from fes_pin.infer.problem import Linearized
from fes_pin.models.model import Model
from fes_pin.models.predictor import Doubt
from fes_pin.models.stage import Effect
from fes_pin.workers import in_parallel

FIRST_LOOK = 15
"""Iterations of a first fit of a set."""
LOOK_DRIVEN = 4
"""Steps of a first fit under what is random in a smaller set."""
ROUNDS = 6
"""Turns of parameters and randomness, at most."""
ALIKE = 0.1
"""Share of a deviation by which its next estimate may differ without another fit: what eight trials tell of it is
uncertain by a quarter, and the likelihood flat about its best value."""


class Fits:
    """Fits on the trials of several groups.

    Parameters
    ----------
    nominal
        The believed model of all groups.
    trials
        By group.
    effects
        The causes that are looked for.
    driven
        True for rigs whose effort answers the reading, which are judged by predictions.

    Attributes
    ----------
    first_weights
        What is random that fits of driven rigs begin with, too: little, and that of each group fitted alone.
    """

    def __init__(
        self, nominal: Model, trials: Mapping[str, Sequence[Trial]], effects: Sequence[type[Effect]], driven: bool
    ) -> None:
        self.nominal, self.trials, self.driven = Model(nominal.rig), dict(trials), driven
        self.every = [t for many in trials.values() for t in many]
        self.first_weights: list[dict[str, Weight]] = []
        self._promised: dict[int, tuple[Grouped, list[Promise], Scores]] = {}
        self.library = Library(self.nominal, self.every, effects)
        self.of_group = {g: Library(self.nominal, many, effects) for g, many in self.trials.items()}
        for one in self.of_group.values():
            one.measured = self.library.measured

    def first(self) -> Grouped:
        """Fit the nominal model to all groups, under the noise that no item of the library could explain."""
        model = GroupedModel(dict.fromkeys(self.trials, self.nominal))
        if self.driven:
            alone = self._alone()
            doubts = {g: f.noise for g, f in alone.items()}
            little = {g: first_guess(self.nominal, t, doubts[g].lasts_s) for g, t in self.trials.items()}
            self.first_weights = [dict(little), dict(doubts)]
            begun = model.with_parameters(next(iter(alone.values())).values)
            return self.converged(begun, (), doubts, None)
        each = {g: self._rich(g) for g in self.trials}
        weights = {g: noise for g, (_, noise) in each.items()}
        fitted = [self.converged(model.with_parameters(v), (), weights, None) for v, _ in each.values()]
        return min(fitted, key=lambda f: f.fit.sse)

    def _alone(self) -> dict[str, LikelihoodFit]:
        """The nominal fit of each group of a driven rig by itself; noise of a reading lasts as long in all of them."""

        def fitted(group: str, lasts_s: float) -> LikelihoodFit:
            trials = self.trials[group]
            problem = LikelihoodProblem(self.nominal, trials, first_guess(self.nominal, trials, lasts_s))
            return maximise(problem, self.nominal.parameters())

        each = {g: with_new_noise(t, partial(fitted, g)) for g, t in self.trials.items()}
        lasts = max(f.noise.lasts_s for f in each.values())
        return {g: f if f.noise.lasts_s == lasts else fitted(g, lasts) for g, f in each.items()}

    def _rich(self, group: str) -> tuple[dict[str, float], Weight]:
        """A group's own nominal values, and its noise beside everything that the library could explain in it alone."""
        trials, library = self.trials[group], self.of_group[group]
        alone = fit_multistart(
            Problem(self.nominal, trials, rough_noise(self.nominal, trials)), self.nominal.parameters()
        )
        white = as_white(noise_of(alone))
        probes = library.probes(alone, white)
        return alone.values, rich_noise(alone, white, [p.columns for p in probes], [[_slopes(alone, white)]])

    def converged(
        self, model: GroupedModel, items: Sequence[Item], weights: Mapping[str, Weight], unknowns: Any
    ) -> Grouped:
        """Fit a grouped model until it converges; of driven rigs with everything that is random."""
        problem = GroupedProblem(model, self.trials, weights)
        if not self.driven:
            fitted = _fitted(problem, model.parameters(), unknowns)
            return self._scattered(Grouped(tuple(items), fitted, weights))
        fitted = _fit_of(problem, alternate(problem, model.parameters(), unknowns, ROUNDS, LOOK_DRIVEN))
        return Grouped(tuple(items), fitted, {g: p.noise for g, p in problem.parts.items()})

    def _scattered(self, one: Grouped) -> Grouped:
        """The set again, with the scatter of repeats that is most likely beside it."""
        for _ in range(ROUNDS):
            weights = self._repeats(one)
            if _alike(weights, one.weights):
                break
            problem = GroupedProblem(one.model, self.trials, weights)
            one = Grouped(one.items, _fitted(problem, one.fit.values, one.fit.unknowns), weights)
        return one

    def _repeats(self, one: Grouped) -> dict[str, Weight]:
        """The noise of each group with how much repeats scatter beside a set."""
        noise = {g: noise_in(w) for g, w in one.weights.items()}
        parts, names, at = self._plain_parts(one), self.nominal.fitted_parameters(), 0
        columns: dict[str, list[np.ndarray]] = {}
        for group, many in self.trials.items():
            own = [one.fit.free.index(one.model.path(n, group)) for n in names]
            columns[group] = [without_locals(p, p.jacobian[:, own]) for p in parts[at : at + len(many)]]
            at += len(many)
        deviations = scatter(parts, [c for many in columns.values() for c in many], names)
        if not deviations:
            return dict(noise)
        chosen, sizes = [names.index(n) for n in deviations], np.array(list(deviations.values()))
        return {g: Repeats(noise[g], deviations, tuple(c[:, chosen] * sizes for c in columns[g])) for g in noise}

    def _plain_parts(self, one: Grouped) -> list[Linearized]:
        """The trials of a fit, whitened with their noise alone."""
        out, at = [], 0
        for group, many in self.trials.items():
            parts, weight = list(one.fit.parts[at : at + len(many)]), one.weights[group]
            out += without_scatter(parts, weight) if isinstance(weight, Repeats) else parts
            at += len(many)
        return out

    def look(self, base: Grouped, promises: Sequence[Promise]) -> Grouped:
        """A first fit of a set with one item more, from its most promising shapes."""
        out = []
        for one in promises:
            model = base.model.with_item(one.item, one.effect).with_parameters(one.start)
            problem = GroupedProblem(model, self.trials, base.weights)
            steps = LOOK_DRIVEN if self.driven else FIRST_LOOK
            fitted = _fitted(problem, model.parameters(), base.fit.unknowns, steps)
            out.append(Grouped((*base.items, one.item), fitted, base.weights))
        return min(out, key=lambda f: f.price)

    def go_on(self, one: Grouped) -> Grouped:
        """Let a set converge; of driven rigs also from little that is random, and from what is in each group alone.

        A smaller set's random effort has taken what it got wrong, and might keep it: a likelihood can have two optima.
        """
        starts = [one.weights, *self.first_weights]
        return min((self.converged(one.model, one.items, w, one.fit.unknowns) for w in starts), key=lambda f: f.price)

    def refined(self, one: Grouped) -> Grouped:
        """The set with the form of its last cause that the data of a driven rig demand; itself if they demand none."""
        item = one.items[-1]
        group = item.group or next(iter(self.trials))
        model = one.model.models[group]
        effect = next((e for e in model.effects if e.name == item.name), None)
        if effect is None or not self.driven:
            return one
        level = DRIVEN_LEVEL / forms_beside(model, [effect])
        demanded = chi2_quantile(1.0 - level, 1)
        starts = [_reformed(one.model, group, m) for m in refinements(model, effect, self.library.measured)]
        looks = sorted(in_parallel(lambda start: self._looked(start, one), starts), key=lambda f: f.price)
        worth = [f for f in looks[:STARTS] if one.fit.sse - f.fit.sse > 0.5 * demanded]
        best = min(in_parallel(self.go_on, worth), key=lambda f: f.price, default=one)
        degrees = max(len(best.fit.free) - len(one.fit.free), 1)
        if not chi2_tail(max(one.fit.sse - best.fit.sse, 0.0), degrees) < level:
            return one
        return self.refined(best)

    def _looked(self, start: GroupedModel, one: Grouped) -> Grouped:
        """A few steps from another form of a set."""
        problem = GroupedProblem(start, self.trials, one.weights)
        fitted = _fitted(problem, start.parameters(), one.fit.unknowns, LOOK_DRIVEN)
        return Grouped(one.items, fitted, one.weights)

    def in_common(self, one: Grouped) -> Grouped:
        """The set with a cause that every group has of its own as one of all, different in all but the first."""
        groups = list(self.trials)
        for name in dict.fromkeys(i.name for i in one.items):
            if all(Item(name, g) in one.items for g in groups) and Item(name) not in one.items:
                items = tuple(Item(name) if i == Item(name, groups[0]) else i for i in one.items)
                model = one.model.with_common(name, groups[1:])
                return self.in_common(self.converged(model, items, one.weights, one.fit.unknowns))
        return one

    def without(self, one: Grouped, item: Item) -> Grouped:
        """The set less one item, fitted from its own values."""
        rest = tuple(i for i in one.items if i != item)
        return self.converged(one.model.without(item, one.items), rest, one.weights, one.fit.unknowns)

    def under_own_noise(self, one: Grouped) -> Grouped:
        """The set again, under the noise that it leaves in each group."""
        if self.driven:
            return one
        weights = {g: self._own_noise(self.part(one, g), one.weights[g]) for g in self.trials}
        return self.converged(one.model, one.items, weights, one.fit.unknowns)

    def _own_noise(self, part: Fit, weight: Weight) -> NoiseModel:
        """The noise that a group's part of a fit leaves; without what its repeats differ by, where they scatter."""
        noise = noise_of(part)
        if not isinstance(weight, Repeats):
            return noise
        white = as_white(noise)
        return rich_noise(part, white, (), [[_slopes(part, white)]])

    def weighed_as(self, one: Grouped, other: Grouped) -> Grouped:
        """The set again, under the weights of another: only then are the residuals of both in one unit."""
        if one.weights == other.weights:
            return one
        problem = GroupedProblem(one.model, self.trials, other.weights)
        fitted = _fitted(problem, one.fit.values, one.fit.unknowns, LOOK_DRIVEN)
        return Grouped(one.items, fitted, other.weights)

    def part(self, one: Grouped, group: str, alone: int | None = None) -> Fit:
        """A group's part of a fit as a fit of that group's own, to its own trials, or to one of them `alone`."""
        model, weight = one.model.models[group], one.weights[group]
        rows = slice(None) if alone is None else slice(alone, alone + 1)
        trials = self.trials[group][rows]
        unknowns = GroupedProblem(one.model, self.trials, one.weights).by_group(one.fit.unknowns)[group][rows]
        if isinstance(weight, Doubt):
            problem = LikelihoodProblem(model, trials, weight)
            return fit_of(problem, minimise(problem, model.parameters(), unknowns, LOOK_DRIVEN))
        return fit_problem(Problem(model, trials, noise_in(weight)), model.parameters(), unknowns)

    def promises(self, base: Grouped) -> tuple[list[Promise], Scores]:
        """Every item that a set does not have, scored; see `promises.promises`."""
        if id(base) not in self._promised:
            self._promised[id(base)] = (base, *promises(Bench(self.nominal, self.trials, self.library), base))
        return self._promised[id(base)][1:]


def _fit_of(problem: GroupedProblem, found: Optimum) -> Fit:
    """The fit of a grouped problem that has ended."""
    return Fit(**ended(problem.model, found), trials=problem.trials, noise=problem.noise)  # type: ignore[arg-type]


def _fitted(problem: GroupedProblem, start: Mapping[str, float], unknowns: Any, steps: int = MAX_ITERATIONS) -> Fit:
    """The fit of a grouped problem from a start."""
    return _fit_of(problem, minimise(problem, start, unknowns, steps))


def _reformed(model: GroupedModel, group: str, own: Model) -> GroupedModel:
    """A grouped model with the values that differ in one group's model."""
    known = model.models[group].parameters()
    return model.with_parameters({model.path(n, group): v for n, v in own.parameters().items() if v != known[n]})


def _slopes(fitted: Fit, white: dict[str, Noise]) -> np.ndarray:
    """Sensitivities to all that is free, scaled with white noise, shape (m, free), all trials end to end."""
    problem = Problem(fitted.model, fitted.trials, white, fitted.free)
    return np.concatenate([p.jacobian for p in problem.linearize(fitted.values, fitted.unknowns)])


def _alike(one: Mapping[str, Weight], other: Mapping[str, Weight]) -> bool:
    """True if repeats scatter as much by two weights, within `ALIKE`."""
    for a, b in zip(one.values(), other.values(), strict=True):
        here, there = (w.deviations if isinstance(w, Repeats) else {} for w in (a, b))
        if set(here) != set(there) or any(abs(here[n] - there[n]) > ALIKE * there[n] for n in here):
            return False
    return True
