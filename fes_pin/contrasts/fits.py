"""Fits of grouped models to the trials of all groups, by simulation or by the likelihood of predictions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from functools import partial

import numpy as np

from fes_pin.contrasts.grouped import Grouped, GroupedModel, GroupedProblem, Item, Weight, by_group
from fes_pin.contrasts.repeats import Repeats, scatter, without_scatter
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.search.library import Library
from fes_pin.identify.correlation_time import with_new_noise
from fes_pin.identify.fit import Fit, fit_multistart, fit_problem, noise_of, rough_noise
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit, fit_of, maximise
from fes_pin.identify.noise_floor import rich_noise
from fes_pin.identify.problem import Problem
from fes_pin.identify.process_noise import first_guess
from fes_pin.infer.maximise import alternate
from fes_pin.infer.noise import Noise, as_white
from fes_pin.infer.optimum import MAX_ITERATIONS, minimise
from fes_pin.infer.problem import Unknowns
from fes_pin.infer.projection import without_locals
from fes_pin.models.model import Model
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.models.stage import Effect

FIRST_LOOK = 15
"""Iterations of a first fit of a set."""
LOOK_DRIVEN = 4
"""Steps of a first fit under what is random in a smaller set."""
ROUNDS = 6
"""Turns of parameters and randomness, at most."""
ALIKE = 0.1
"""Share of a deviation by which its next estimate may differ without another fit: what eight trials tell of it is
uncertain by a quarter, and the likelihood flat about its best value."""


class GroupedFits(ABC):
    """Fits of grouped models to some trials.

    Parameters
    ----------
    nominal
        The believed model of all groups.
    trials
        By group.
    """

    first_steps: int
    """Of a first fit of a set."""

    def __init__(self, nominal: Model, trials: Mapping[str, Sequence[Trial]]) -> None:
        self.nominal, self.trials = Model(nominal.rig), dict(trials)

    @abstractmethod
    def first(self) -> Grouped:
        """Fit the nominal model to all groups."""

    @abstractmethod
    def converged(
        self, model: GroupedModel, items: Collection[Item], weights: Mapping[str, Weight], unknowns: Unknowns | None
    ) -> Grouped:
        """Fit a grouped model until it converges."""

    def go_on(self, one: Grouped) -> Grouped:
        """Let a set converge."""
        return self.converged(one.model, one.items, one.weights, one.fit.unknowns)

    def look(self, model: GroupedModel, items: Collection[Item], base: Grouped) -> Grouped:
        """A first fit of a model under the weights of another set."""
        return self._fitted(model, items, base.weights, base.fit.unknowns, self.first_steps)

    def under_own_noise(self, one: Grouped) -> Mapping[str, Weight] | None:
        """The noise that a set leaves in each group; None where every fit has its own."""
        return None

    def weighed_as(self, one: Grouped, other: Grouped) -> Grouped:
        """The set again, under the weights of another: only then are the residuals of both in one unit."""
        if one.weights == other.weights:
            return one
        return self._fitted(one.model, one.items, other.weights, one.fit.unknowns, LOOK_DRIVEN)

    def refitted(self, one: Grouped, held: Collection[int]) -> Grouped:
        """The set again, fitted without some trials, by their numbers, under its own weights."""
        kept = {
            g: [k for k, i in enumerate(own) if i not in held]
            for g, own in by_group(range(len(one.fit.trials)), self.trials).items()
        }
        trials = {g: [self.trials[g][k] for k in ks] for g, ks in kept.items()}
        weights = {g: w if isinstance(w, StateSpaceNoise) else w.of_trials(kept[g]) for g, w in one.weights.items()}
        problem = GroupedProblem(one.model, trials, weights)
        unknowns = [u for k, u in enumerate(one.fit.unknowns) if k not in held]
        return Grouped.of(one.items, problem, minimise(problem, one.fit.values, unknowns), weights)

    def part(self, one: Grouped, group: str, alone: int | None = None) -> Fit:
        """A group's part of a fit as a fit of that group's own, to its own trials, or to one of them `alone`."""
        model, weight = one.model.models[group], one.weights[group]
        rows = slice(None) if alone is None else slice(alone, alone + 1)
        trials = self.trials[group][rows]
        unknowns = by_group(one.fit.unknowns, self.trials)[group][rows]
        if isinstance(weight, StateSpaceNoise):
            problem = LikelihoodProblem(model, trials, weight)
            return fit_of(problem, minimise(problem, model.parameters(), unknowns, LOOK_DRIVEN))
        return fit_problem(Problem(model, trials, weight.noise), model.parameters(), unknowns)

    def _fitted(
        self,
        model: GroupedModel,
        items: Collection[Item],
        weights: Mapping[str, Weight],
        unknowns: Unknowns | None,
        steps: int = MAX_ITERATIONS,
    ) -> Grouped:
        problem = GroupedProblem(model, self.trials, weights)
        return Grouped.of(items, problem, minimise(problem, model.parameters(), unknowns, steps), weights)


class PredictedGroups(GroupedFits):
    """Fits by the likelihood of predictions, each with everything that is random."""

    first_steps = LOOK_DRIVEN

    def first(self) -> Grouped:
        """Fit the nominal model to all groups; the search starts from the noise of each group fitted alone."""
        alone = self._alone()
        noises = {g: f.noise for g, f in alone.items()}
        little = {g: first_guess(self.nominal, t, noises[g].correlation_s) for g, t in self.trials.items()}
        self._begun: list[Mapping[str, Weight]] = [dict(little), dict(noises)]
        model = GroupedModel(dict.fromkeys(self.trials, self.nominal))
        return self.converged(model.with_parameters(next(iter(alone.values())).values), (), noises, None)

    def _alone(self) -> dict[str, LikelihoodFit]:
        """The nominal fit of each group alone; measurement noise has the same correlation time in all groups."""

        def fitted(group: str, correlation_s: float) -> LikelihoodFit:
            trials = self.trials[group]
            problem = LikelihoodProblem(self.nominal, trials, first_guess(self.nominal, trials, correlation_s))
            return maximise(problem, self.nominal.parameters())

        each = {g: with_new_noise(t, partial(fitted, g)) for g, t in self.trials.items()}
        longest = max(f.noise.correlation_s for f in each.values())
        return {g: f if f.noise.correlation_s == longest else fitted(g, longest) for g, f in each.items()}

    def converged(
        self, model: GroupedModel, items: Collection[Item], weights: Mapping[str, Weight], unknowns: Unknowns | None
    ) -> Grouped:
        """Fit a grouped model and its noise by alternating maximisation."""
        problem = GroupedProblem(model, self.trials, weights)
        found = alternate(problem, model.parameters(), unknowns, ROUNDS, LOOK_DRIVEN)
        return Grouped.of(items, problem, found, {g: p.noise for g, p in problem.parts.items()})

    def go_on(self, one: Grouped) -> Grouped:
        """Let a set converge; also from little that is random, and from what is in each group alone.

        A smaller set's random effort has taken what it got wrong, and might keep it: a likelihood can have two optima.
        """
        starts = [one.weights, *self._begun]
        return min(
            (self.converged(one.model, one.items, w, one.fit.unknowns) for w in starts), key=lambda f: f.criterion
        )


class SimulatedGroups(GroupedFits):
    """Fits by simulation under given noise, and how much repeats scatter.

    Parameters
    ----------
    effects
        The causes that are looked for.
    """

    first_steps = FIRST_LOOK

    def __init__(self, nominal: Model, trials: Mapping[str, Sequence[Trial]], effects: Sequence[type[Effect]]) -> None:
        super().__init__(nominal, trials)
        self._effects = effects
        self._measured = Library(self.nominal, [t for many in self.trials.values() for t in many], ()).measured

    def first(self) -> Grouped:
        """Fit the nominal model to all groups, under the noise that no cause of the library could explain."""
        model = GroupedModel(dict.fromkeys(self.trials, self.nominal))
        each = {g: self._rich(g) for g in self.trials}
        weights = {g: noise for g, (_, noise) in each.items()}
        fitted = [self.converged(model.with_parameters(v), (), weights, None) for v, _ in each.values()]
        return min(fitted, key=lambda f: f.sse)

    def _rich(self, group: str) -> tuple[dict[str, float], Repeats]:
        """A group's own nominal values, and its noise without what the library could explain in it alone."""
        trials, library = self.trials[group], Library(self.nominal, self.trials[group], self._effects)
        library.measured = self._measured
        alone = fit_multistart(
            Problem(self.nominal, trials, rough_noise(self.nominal, trials)), self.nominal.parameters()
        )
        white = as_white(noise_of(alone))
        probes = library.probes(alone, white)
        return alone.values, Repeats(rich_noise(alone, white, [p.columns for p in probes], [[_slopes(alone, white)]]))

    def converged(
        self, model: GroupedModel, items: Collection[Item], weights: Mapping[str, Weight], unknowns: Unknowns | None
    ) -> Grouped:
        """Fit a grouped model with the scatter of repeats that is most likely in it."""
        one = self._fitted(model, items, weights, unknowns)
        for _ in range(ROUNDS):
            repeats = self._repeats(one)
            if all(_alike(w, one.weights[g]) for g, w in repeats.items()):
                break
            one = self._fitted(one.model, items, repeats, one.fit.unknowns)
        return one

    def _repeats(self, one: Grouped) -> dict[str, Repeats]:
        """The noise of each group, with how much repeats scatter by the model of a set."""
        names, cut, parts = self.nominal.fitted_parameters(), by_group(one.fit.parts, self.trials), []
        columns: dict[str, list[np.ndarray]] = {}
        weights = {g: w for g, w in one.weights.items() if isinstance(w, Repeats)}
        for group, weight in weights.items():
            own = [one.fit.free.index(one.model.path(n, group)) for n in names]
            plain = without_scatter(cut[group], weight)
            columns[group] = [without_locals(p, p.jacobian[:, own]) for p in plain]
            parts += plain
        deviations = scatter(parts, [c for many in columns.values() for c in many], names)
        chosen, sizes = [names.index(n) for n in deviations], np.array(list(deviations.values()))
        along = {g: tuple(c[:, chosen] * sizes for c in many) if chosen else () for g, many in columns.items()}
        return {g: Repeats(w.noise, deviations, along[g]) for g, w in weights.items()}

    def under_own_noise(self, one: Grouped) -> Mapping[str, Weight]:
        """The noise that a set leaves in each group; without what repeats differ by, where they scatter."""
        out: dict[str, Weight] = {}
        for group in self.trials:
            part = self.part(one, group)
            noise = noise_of(part)
            white = as_white(noise)
            out[group] = Repeats(rich_noise(part, white, (), [[_slopes(part, white)]]) if one.repeats else noise)
        return out


def _slopes(fitted: Fit, white: dict[str, Noise]) -> np.ndarray:
    """Sensitivities to all that is free, scaled with white noise, shape (m, free), all trials end to end."""
    problem = Problem(fitted.model, fitted.trials, white, fitted.free)
    return np.concatenate([p.jacobian for p in problem.linearize(fitted.values, fitted.unknowns)])


def _alike(one: Repeats, other: Weight) -> bool:
    """True if repeats scatter as much by two weights, within `ALIKE`."""
    here, there = one.deviations, other.deviations if isinstance(other, Repeats) else {}
    return set(here) == set(there) and all(abs(here[n] - there[n]) <= ALIKE * there[n] for n in here)
