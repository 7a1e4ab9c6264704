"""Fits of grouped models: one set of items on the trials of all groups."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from fes_pin.contrast.grouped import Grouped, GroupedModel, GroupedProblem, Item, Weight, noise_in
from fes_pin.contrast.promises import Bench, Promise, promises
from fes_pin.contrast.repeats import Repeats, scatter, without_locals
from fes_pin.data.trial import Trial
from fes_pin.diagnose.search.library import Library
from fes_pin.diagnose.search.likelihood_fits import STARTS, refinements
from fes_pin.diagnose.search.likelihood_search import REFINE_LEVEL
from fes_pin.diagnose.search.score import Scores
from fes_pin.identify.descent import TOLERANCE
from fes_pin.identify.distributions import chi2_quantile, chi2_tail
from fes_pin.identify.fit import Fit, fit_multistart, fit_problem, noise_of, rough_noise
from fes_pin.identify.likelihood import LikelihoodProblem, first_guess, maximise, score_doubt
from fes_pin.identify.noise import as_white
from fes_pin.identify.noise_floor import rich_noise
from fes_pin.identify.problem import Problem
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
        self.library = Library(self.nominal, self.every, effects)
        self.of_group = {g: Library(self.nominal, many, effects) for g, many in self.trials.items()}
        for one in self.of_group.values():
            one.measured = self.library.measured

    def first(self) -> Grouped:
        """Fit the nominal model to all groups, under the noise that no item of the library could explain."""
        model = GroupedModel(dict.fromkeys(self.trials, self.nominal))
        if self.driven:
            weights: dict[str, Weight] = {g: first_guess(self.nominal, t) for g, t in self.trials.items()}
            alone = {
                g: maximise(LikelihoodProblem(self.nominal, t, weights[g]), self.nominal.parameters())  # type: ignore[arg-type]
                for g, t in self.trials.items()
            }
            self.first_weights = [weights, {g: f.doubt for g, f in alone.items() if f.doubt is not None}]
            weights = self.first_weights[-1]
            begun = model.with_parameters(next(iter(alone.values())).values)
            return self.converged(begun, (), weights, None)
        each = {g: self._rich(g) for g in self.trials}
        weights = {g: noise for g, (_, noise) in each.items()}
        fitted = [self.converged(model.with_parameters(v), (), weights, None) for v, _ in each.values()]
        return min(fitted, key=lambda f: f.fit.sse)

    def _rich(self, group: str) -> tuple[dict[str, float], Weight]:
        """A group's own nominal values, and its noise beside everything that the library could explain in it alone."""
        trials, library = self.trials[group], self.of_group[group]
        alone = fit_multistart(
            Problem(self.nominal, trials, rough_noise(self.nominal, trials)), self.nominal.parameters()
        )
        white = as_white(noise_of(alone))
        probes = library.probes(alone, white)
        return alone.values, rich_noise(alone, white, [p.columns for p in probes])

    def converged(
        self, model: GroupedModel, items: Sequence[Item], weights: Mapping[str, Weight], unknowns: Any
    ) -> Grouped:
        """Fit a grouped model until it converges; of driven rigs with everything that is random."""
        problem = GroupedProblem(model, self.trials, weights)
        if not self.driven:
            fitted = fit_problem(problem, model.parameters(), unknowns)  # type: ignore[arg-type]
            return self._scattered(Grouped(tuple(items), fitted, weights))
        fitted = fit_problem(problem, model.parameters(), unknowns, LOOK_DRIVEN)  # type: ignore[arg-type]
        for _ in range(ROUNDS):
            before = fitted.sse
            for group, part in problem.parts.items():
                own = problem.by_group(fitted.unknowns)[group]
                score_doubt(part, fitted.model.of(group, fitted.values), own)  # type: ignore[attr-defined]
            fitted = fit_problem(problem, fitted.values, fitted.unknowns, LOOK_DRIVEN)  # type: ignore[arg-type]
            if not fitted.sse < before - 10.0 * TOLERANCE:
                break
        return Grouped(tuple(items), fitted, {g: p.doubt for g, p in problem.parts.items()})

    def _scattered(self, one: Grouped) -> Grouped:
        """The set again, with the scatter of repeats that is most likely beside it."""
        best = one
        for _ in range(ROUNDS):
            weights = self._repeats(best)
            problem = GroupedProblem(best.model, self.trials, weights)
            fitted = fit_problem(problem, best.fit.values, best.fit.unknowns)  # type: ignore[arg-type]
            before, best = best, Grouped(one.items, fitted, weights)
            if not best.fit.sse < before.fit.sse - 10.0 * TOLERANCE:
                break
        return best

    def _repeats(self, one: Grouped) -> dict[str, Weight]:
        """The noise of each group with how much repeats scatter beside a set."""
        noise = {g: noise_in(w) for g, w in one.weights.items()}
        problem = GroupedProblem(one.model, self.trials, noise)
        parts = problem.linearize(one.fit.values, one.fit.unknowns)
        names = self.nominal.fitted_parameters()
        paths = [[one.model.path(n, g) for n in names] for g, many in self.trials.items() for _ in many]
        columns = [p.jacobian[:, [problem.free.index(n) for n in own]] for p, own in zip(parts, paths, strict=True)]
        deviations = scatter(parts, columns, names)
        if not deviations:
            return dict(noise)
        at = [names.index(n) for n in deviations]
        along = [without_locals(p, c[:, at] * list(deviations.values())) for p, c in zip(parts, columns, strict=True)]
        cut = problem.by_group(along)
        return {g: Repeats(noise[g], deviations, tuple(cut[g])) for g in noise}

    def look(self, base: Grouped, promises: Sequence[Promise]) -> Grouped:
        """A first fit of a set with one item more, from its most promising shapes."""
        out = []
        for one in promises:
            model = base.model.with_item(one.item, one.effect).with_parameters(one.start)
            problem = GroupedProblem(model, self.trials, base.weights)
            steps = LOOK_DRIVEN if self.driven else FIRST_LOOK
            fitted = fit_problem(problem, model.parameters(), base.fit.unknowns, steps)  # type: ignore[arg-type]
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
        demanded = chi2_quantile(1.0 - REFINE_LEVEL, 1)
        starts = [_reformed(one.model, group, m) for m in refinements(model, effect, self.library.measured)]
        looks = sorted(in_parallel(lambda start: self._looked(start, one), starts), key=lambda f: f.price)
        worth = [f for f in looks[:STARTS] if one.fit.sse - f.fit.sse > 0.5 * demanded]
        best = min(in_parallel(self.go_on, worth), key=lambda f: f.price, default=one)
        degrees = max(len(best.fit.free) - len(one.fit.free), 1)
        if not chi2_tail(max(one.fit.sse - best.fit.sse, 0.0), degrees) < REFINE_LEVEL:
            return one
        return self.refined(best)

    def _looked(self, start: GroupedModel, one: Grouped) -> Grouped:
        """A few steps from another form of a set."""
        problem = GroupedProblem(start, self.trials, one.weights)
        fitted = fit_problem(problem, start.parameters(), one.fit.unknowns, LOOK_DRIVEN)  # type: ignore[arg-type]
        return Grouped(one.items, fitted, one.weights)

    def without(self, one: Grouped, item: Item) -> Grouped:
        """The set less one item, fitted from its own values."""
        rest = tuple(i for i in one.items if i != item)
        return self.converged(one.model.without(item, one.items), rest, one.weights, one.fit.unknowns)

    def under_own_noise(self, one: Grouped) -> Grouped:
        """The set again, under the noise that it leaves in each group."""
        if self.driven:
            return one
        weights = {g: noise_of(self.part(one, g)) for g in self.trials}
        return self.converged(one.model, one.items, weights, one.fit.unknowns)

    def weighed_as(self, one: Grouped, other: Grouped) -> Grouped:
        """The set again, under the weights of another: only then are the residuals of both in one unit."""
        if one.weights == other.weights:
            return one
        problem = GroupedProblem(one.model, self.trials, other.weights)
        fitted = fit_problem(problem, one.fit.values, one.fit.unknowns, LOOK_DRIVEN)  # type: ignore[arg-type]
        return Grouped(one.items, fitted, other.weights)

    def part(self, one: Grouped, group: str, alone: int | None = None) -> Fit:
        """A group's part of a fit as a fit of that group's own, to its own trials, or to one of them `alone`."""
        model, weight = one.model.models[group], one.weights[group]
        rows = slice(None) if alone is None else slice(alone, alone + 1)
        trials = self.trials[group][rows]
        unknowns = GroupedProblem(one.model, self.trials, one.weights).by_group(one.fit.unknowns)[group][rows]
        if isinstance(weight, Doubt):
            problem: Any = LikelihoodProblem(model, trials, weight)
            return replace(fit_problem(problem, model.parameters(), unknowns, LOOK_DRIVEN), doubt=weight)
        return fit_problem(Problem(model, trials, noise_in(weight)), model.parameters(), unknowns)

    def promises(self, base: Grouped) -> tuple[list[Promise], Scores]:
        """Every item that a set does not have, scored; see `promises.promises`."""
        return promises(Bench(self.nominal, self.trials, self.library), base)


def _reformed(model: GroupedModel, group: str, own: Model) -> GroupedModel:
    """A grouped model with the values that differ in one group's model."""
    known = model.models[group].parameters()
    return model.with_parameters({model.path(n, group): v for n, v in own.parameters().items() if v != known[n]})
