"""Fits of grouped models, and what every item of the library promises beside one."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fes_pin.contrast.grouped import GroupedModel, GroupedProblem, Item, Weight
from fes_pin.data.trial import Trial
from fes_pin.diagnose.search.library import Library, near_null
from fes_pin.diagnose.search.score import Projection, Scores
from fes_pin.identify.descent import TOLERANCE
from fes_pin.identify.fit import PARAMETER_PRICE, Fit, fit_multistart, fit_problem, noise_of, rough_noise
from fes_pin.identify.likelihood import LikelihoodProblem, first_guess, maximise, score_doubt
from fes_pin.identify.noise import as_white
from fes_pin.identify.noise_floor import rich_noise
from fes_pin.identify.problem import Linearized, Problem
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


@dataclass(frozen=True)
class Grouped:
    """A fitted grouped model.

    Attributes
    ----------
    items
        What it has beside the nominal model, in the order in which it was found.
    fit
        Its `model` is the grouped one; `sse` twice the negative log-likelihood, but for a constant.
    weights
        By group.
    """

    items: tuple[Item, ...]
    fit: Fit
    weights: Mapping[str, Weight]

    @property
    def model(self) -> GroupedModel:
        """The grouped model, fitted."""
        return self.fit.model  # type: ignore[return-value]

    @property
    def price(self) -> float:
        """What the set costs, with what each parameter must earn."""
        return self.fit.sse + PARAMETER_PRICE * len(self.fit.free)

    @property
    def changes(self) -> tuple[Item, ...]:
        """The items that differ in one group."""
        return tuple(i for i in self.items if i.group is not None)


@dataclass(frozen=True)
class Promise:
    """What an item would add to a set, linearly.

    Attributes
    ----------
    effect
        The cause with its start values; None for a parameter, or a cause, that the group's model has.
    gain
        Drop in twice the negative log-likelihood.
    degrees
        Parameters that it adds.
    kept
        Share of its sensitivity that the set does not take up.
    deviation
        Standard deviation of its first amplitude.
    start
        Value that a parameter would have.
    spread
        Variance of what single trials say of it, in units of what the noise explains; at least 1.
    """

    item: Item
    effect: Effect | None
    gain: float
    degrees: int
    kept: float
    deviation: float
    start: Mapping[str, float]
    spread: float = 1.0


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
    """

    def __init__(
        self, nominal: Model, trials: Mapping[str, Sequence[Trial]], effects: Sequence[type[Effect]], driven: bool
    ) -> None:
        self.nominal, self.trials, self.driven = Model(nominal.rig), dict(trials), driven
        self.every = [t for many in trials.values() for t in many]
        self.alone: dict[str, Weight] = {}
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
            self.alone = weights = {g: f.doubt for g, f in alone.items() if f.doubt is not None}
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
            return Grouped(tuple(items), fitted, weights)
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
        """Let a set converge; of driven rigs also from what is random in each group fitted alone.

        A smaller set's random effort has taken what it got wrong, and might keep it: a likelihood can have two optima.
        """
        starts = [one.weights, self.alone] if self.alone else [one.weights]
        return min((self.converged(one.model, one.items, w, one.fit.unknowns) for w in starts), key=lambda f: f.price)

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

    def part(self, one: Grouped, group: str) -> Fit:
        """A group's part of a fit as a fit of that group's own, to its own trials."""
        model, weight = one.model.models[group], one.weights[group]
        trials = self.trials[group]
        unknowns = GroupedProblem(one.model, self.trials, one.weights).by_group(one.fit.unknowns)[group]
        if isinstance(weight, Doubt):
            problem: Any = LikelihoodProblem(model, trials, weight)
            return replace(fit_problem(problem, model.parameters(), unknowns, LOOK_DRIVEN), doubt=weight)
        return fit_problem(Problem(model, trials, weight), model.parameters(), unknowns)

    def promises(self, base: Grouped) -> tuple[list[Promise], Scores]:
        """Every item that a set does not have, scored; and the Gram matrix of what is left of all columns."""
        projection = Projection(base.fit.parts)
        before: list[np.ndarray] = []
        made: list[tuple[Item, Effect | None, tuple[str, ...], np.ndarray]] = []
        for item, effect, names, columns in self._candidates(base):
            before.append(np.linalg.norm(columns, axis=0))
            made.append((item, effect, names, projection(np.nan_to_num(columns))))
        left = np.concatenate([m[3] for m in made], axis=1)
        gram, along = left.T @ left, left.T @ projection.residual
        ends = np.cumsum([0, *(m[3].shape[1] for m in made)])
        blocks = [slice(a, b) for a, b in itertools.pairwise(ends)]
        out = [
            replace(
                _promise(base.model, m[:3], gram[b, b], along[b], norms),
                spread=_spread(m[3][:, 0], projection.residual, base.fit.parts),
            )
            for m, b, norms in zip(made, blocks, before, strict=True)
        ]
        tested = [b for m, b in zip(made, blocks, strict=True) if m[0].group is not None]
        return out, Scores([], gram, along, tested)

    def _candidates(self, base: Grouped) -> Iterator[tuple[Item, Effect | None, tuple[str, ...], np.ndarray]]:
        """Items with the names of their amplitudes and their whitened columns."""
        groups, parts = list(self.trials), base.fit.parts
        counts = [len(t) for t in self.trials.values()]
        ends = np.cumsum([0, *(len(p.residual) for p in parts)])
        cuts = [ends[k] for k in np.cumsum([0, *counts])]
        rows = {g: slice(cuts[k], cuts[k + 1]) for k, g in enumerate(groups)}
        for item in self._differing(base):
            assert item.group is not None
            yield item, None, *_own_columns(base.model, item, parts, rows[item.group])
        known = {g: [e.name for e in m.effects] for g, m in base.model.models.items()}
        wanted = [e for e in self.library.effects if self.library.felt(e)]
        for effect, by_group in zip(wanted, in_parallel(lambda e: self._columns(e, base), wanted), strict=True):
            names = tuple(f"{effect.name}.{n}" for n in effect.amplitudes())
            for k, one in enumerate(self.library.grid(effect)):
                pieces = {g: by_group[g][k] for g in groups}
                masked = {g: np.zeros((ends[-1], len(names))) for g in groups}
                for g in groups:
                    masked[g][rows[g]] = pieces[g]
                if not any(effect.name in n for n in known.values()):
                    yield Item(effect.name), one, names, np.sum(list(masked.values()), axis=0)
                for g in groups:
                    if effect.name not in known[g]:
                        yield Item(effect.name, g), one, names, masked[g]

    def _differing(self, base: Grouped) -> Iterator[Item]:
        """Parameters and causes that a set has, and that could have a value of their own in a group.

        Of two groups it is one and the same which of them has it: the second.
        """
        groups = list(self.trials)
        common = [i.name for i in base.items if i.group is None]
        for name in (*self.nominal.fitted_parameters(), *common):
            taken = [i.group for i in base.items if i.name == name and i.group is not None]
            if len(taken) < len(groups) - 1:
                free = groups[1:] if len(groups) == 2 else groups
                yield from (Item(name, g) for g in free if g not in taken)

    def _columns(self, effect: type[Effect], base: Grouped) -> dict[str, list[np.ndarray]]:
        """Sensitivities to an effect's amplitudes for each of its shapes, by group."""
        out = {}
        cut = GroupedProblem(base.model, self.trials, base.weights).by_group(base.fit.unknowns)
        for group, model in base.model.models.items():
            bare, trials, weight = Model(model.rig), self.trials[group], base.weights[group]
            extended = bare + effect.absent()
            names = [f"{effect.name}.{n}" for n in effect.amplitudes()]
            if isinstance(weight, Doubt):
                problem: Any = LikelihoodProblem(extended, trials, weight)
                at = [problem.free.index(n) for n in names]
            else:
                problem = Problem(extended, trials, weight, tuple(names))
                at = list(range(len(names)))
            unknowns = problem.completed(cut[group])
            out[group] = [
                np.concatenate([p.jacobian[:, at] for p in problem.linearize((bare + one).parameters(), unknowns)])
                for one in self.library.grid(effect)
            ]
        return out


def _own_columns(
    model: GroupedModel, item: Item, parts: Sequence[Linearized], rows: slice
) -> tuple[tuple[str, ...], np.ndarray]:
    """Columns of a parameter, or a cause's amplitudes, in one group alone."""
    assert item.group is not None
    names = [item.name]
    for effect in model.models[item.group].effects:
        if effect.name == item.name:
            names = [f"{effect.name}.{n}" for n in effect.amplitudes()]
    paths = [model.path(n, item.group) for n in names]
    at = [model.free.index(p) for p in paths]
    columns = np.concatenate([p.jacobian for p in parts])[:, at]
    out = np.zeros_like(columns)
    out[rows] = columns[rows]
    return tuple(names), out


def _promise(
    model: GroupedModel,
    what: tuple[Item, Effect | None, tuple[str, ...]],
    gram: np.ndarray,
    along: np.ndarray,
    norms: np.ndarray,
) -> Promise:
    item, effect, names = what
    size = np.sqrt(np.maximum(np.diag(gram), 0.0))
    kept = float(np.max(size / np.where(norms > 0.0, norms, np.inf), initial=0.0))
    degrees = len(names)
    if effect is not None:
        degrees = len(effect.fitted_parameters())
    if kept < 1e-6:
        return Promise(item, effect, 0.0, degrees, 0.0, np.inf, {})
    scale = 1.0 / np.maximum(size, 1e-300)
    inverse = np.linalg.pinv(gram * np.outer(scale, scale), rcond=1e-10, hermitian=True)
    step = scale * (inverse @ (along * scale))
    deviation = float(scale[0] * np.sqrt(max(inverse[0, 0], 0.0)))
    if effect is not None:
        info = effect.parameters()
        nulls = np.array([info[n.split(".")[1]].null or 0.0 for n in names])
        low, high = np.array([[info[n.split(".")[1]].lower, info[n.split(".")[1]].upper] for n in names]).T
        step = np.clip(step, low - nulls, high - nulls)
        effect = _started(effect, dict(zip(names, (float(v) for v in step + nulls), strict=True)))
        start: dict[str, float] = {}
    else:
        assert item.group is not None
        values, limits = model.parameters(), model.parameter_info()
        start = {}
        for name, move in zip(names, step, strict=True):
            path = model.path(name, item.group)
            wanted = float(np.clip(values[path] + move, limits[path].lower, limits[path].upper))
            start[f"{name}@{item.group}"] = wanted if wanted else values[path]
    gain = float(2.0 * along @ step - step @ gram @ step)
    return Promise(item, effect, gain, degrees, kept, deviation, start)


def _started(effect: Effect, amplitudes: Mapping[str, float]) -> Effect:
    """The effect at a linear estimate, or a step from its null where that says nothing."""
    info, values = effect.parameters(), {}
    for path, value in amplitudes.items():
        name = path.split(".")[1]
        null = info[name].null or 0.0
        values[name] = near_null(type(effect), name) if abs(value - null) < 1e-6 * info[name].scale else value
    return replace(effect, **values)  # type: ignore[arg-type]


def _spread(column: np.ndarray, residual: np.ndarray, parts: Sequence[Linearized]) -> float:
    """Variance of what each trial says of a parameter, in units of what the noise explains."""
    ends = np.cumsum([0, *(len(p.residual) for p in parts)])
    cuts = [slice(a, b) for a, b in itertools.pairwise(ends)]
    sizes = np.array([float(column[c] @ column[c]) for c in cuts])
    along = np.array([float(column[c] @ residual[c]) for c in cuts])
    felt = sizes > 1e-4 * max(float(sizes.max()), 1e-300)
    free = int(felt.sum()) - 2
    return max(1.0, float(np.sum(along[felt] ** 2 / sizes[felt])) / free) if free > 0 else 1.0
