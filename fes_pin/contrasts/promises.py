"""What every item of the library promises beside a grouped fit, linearly."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fes_pin.contrasts.grouped import Grouped, GroupedModel, GroupedProblem, Item, Weight, group_problem
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.search.library import Library
from fes_pin.diagnosis.search.score import Projection, Scores
from fes_pin.diagnosis.search.starts import started
from fes_pin.infer.family import MIN_UNITS
from fes_pin.infer.problem import Linearized, completed
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect
from fes_pin.workers import in_parallel

FEWEST_TRIALS = 6
"""Trials that alone show how much repeats differ; of fewer each is cut into pieces, as a diagnosis does."""
UNFELT = 1e-4
"""Share of the largest part that a unit must have in a change to say something of its spread."""


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
    spread, spread_degrees
        Variance of what single trials say of it, in units of what the noise explains, and its degrees of freedom.
    """

    item: Item
    effect: Effect | None
    gain: float
    degrees: int
    kept: float
    deviation: float
    start: Mapping[str, float]
    spread: float = 1.0
    spread_degrees: int = 0


@dataclass(frozen=True)
class Bench:
    """The trials of all groups, and the causes that are looked for in them.

    Attributes
    ----------
    nominal
        The rig, without effects.
    trials
        By group.
    library
        Of all trials together.
    """

    nominal: Model
    trials: Mapping[str, Sequence[Trial]]
    library: Library


def promises(bench: Bench, base: Grouped) -> tuple[list[Promise], Scores]:
    """Every item that a set does not have, scored; and the Gram matrix of what is left of all columns."""
    projection = Projection(base.fit.parts)
    before: list[np.ndarray] = []
    made: list[tuple[Item, Effect | None, tuple[str, ...], np.ndarray]] = []
    for item, effect, names, columns in _candidates(bench, base):
        before.append(np.linalg.norm(columns, axis=0))
        made.append((item, effect, names, projection(np.nan_to_num(columns))))
    left = np.concatenate([m[3] for m in made], axis=1)
    gram, along = left.T @ left, left.T @ projection.residual
    ends = np.cumsum([0, *(m[3].shape[1] for m in made)])
    blocks = [slice(a, b) for a, b in itertools.pairwise(ends)]
    out = []
    for m, b, norms in zip(made, blocks, before, strict=True):
        spread, free = _spread(m[3][:, 0], projection.residual, base.fit.parts)
        out.append(
            replace(_promise(base.model, m[:3], gram[b, b], along[b], norms), spread=spread, spread_degrees=free)
        )
    tested = [b for m, b in zip(made, blocks, strict=True) if m[0].group is not None]
    return out, Scores([], gram, along, tested)


def _candidates(bench: Bench, base: Grouped) -> Iterator[tuple[Item, Effect | None, tuple[str, ...], np.ndarray]]:
    """Items with the names of their amplitudes and their whitened columns."""
    groups, parts = list(bench.trials), base.fit.parts
    counts = [len(t) for t in bench.trials.values()]
    ends = np.cumsum([0, *(len(p.residual) for p in parts)])
    cuts = [ends[k] for k in np.cumsum([0, *counts])]
    rows = {g: slice(cuts[k], cuts[k + 1]) for k, g in enumerate(groups)}
    for item in _differing(bench, base):
        assert item.group is not None
        yield item, None, *_own_columns(base.model, item, parts, rows[item.group])
    known = {g: [e.name for e in m.effects] for g, m in base.model.models.items()}
    wanted = [e for e in bench.library.effects if bench.library.felt(e)]
    for effect, by_group in zip(wanted, in_parallel(lambda e: _columns(bench, e, base), wanted), strict=True):
        names = tuple(f"{effect.name}.{n}" for n in effect.amplitudes())
        for k, one in enumerate(bench.library.grid(effect)):
            pieces = {g: by_group[g][k] for g in groups}
            masked = {g: np.zeros((ends[-1], len(names))) for g in groups}
            for g in groups:
                masked[g][rows[g]] = pieces[g]
            if not any(effect.name in n for n in known.values()):
                yield Item(effect.name), one, names, np.sum(list(masked.values()), axis=0)
            for g in groups:
                if effect.name not in known[g]:
                    yield Item(effect.name, g), one, names, masked[g]


def _differing(bench: Bench, base: Grouped) -> Iterator[Item]:
    """Parameters and causes that a set has, and that could have a value of their own in a group.

    Of two groups it is one and the same which of them has it: the second.
    """
    groups = list(bench.trials)
    common = [i.name for i in base.items if i.group is None]
    for name in (*bench.nominal.fitted_parameters(), *common):
        taken = [i.group for i in base.items if i.name == name and i.group is not None]
        if len(taken) < len(groups) - 1:
            free = groups[1:] if len(groups) == 2 else groups
            yield from (Item(name, g) for g in free if g not in taken)


def _columns(bench: Bench, effect: type[Effect], base: Grouped) -> dict[str, list[np.ndarray]]:
    """Sensitivities to an effect's amplitudes for each of its shapes, by group."""
    out: dict[str, list[np.ndarray]] = {}
    cut = GroupedProblem(base.model, bench.trials, base.weights).by_group(base.fit.unknowns)
    for group, model in base.model.models.items():
        bare, trials, weight = Model(model.rig), bench.trials[group], base.weights[group]
        problems: dict[tuple, tuple[Any, list[int]]] = {}
        out[group] = []
        for one in bench.library.grid(effect):
            form = tuple(one.unused().items())  # compiled in, with its values
            if form not in problems:
                problems[form] = _problem(bare + one, trials, weight)
            problem, at = problems[form]
            parts = problem.linearize((bare + one).parameters(), completed(problem.start_unknowns(), cut[group]))
            out[group].append(np.concatenate([p.jacobian[:, at] for p in parts]))
    return out


def _problem(model: Model, trials: Sequence[Trial], weight: Weight) -> tuple[Any, list[int]]:
    """The problem of one effect beside the nominal model, and where its amplitudes stand among what is free."""
    (effect,) = model.effects
    names = [f"{effect.name}.{n}" for n in effect.amplitudes()]
    problem = group_problem(model, trials, weight, tuple(names))
    return problem, [problem.free.index(n) for n in names]


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
        effect = started(effect, dict(zip(effect.amplitudes(), (float(v) for v in step + nulls), strict=True)))
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


def units(parts: Sequence[Linearized]) -> list[slice]:
    """Rows of each unit of evidence: a trial, or a piece of one where trials are few."""
    pieces = 1 if len(parts) >= FEWEST_TRIALS else -(-MIN_UNITS // len(parts))
    ends = itertools.accumulate((len(p.residual) for p in parts), initial=0)
    cuts = [np.linspace(a, b, pieces + 1).round().astype(int) for a, b in itertools.pairwise(ends)]
    return [slice(int(a), int(b)) for cut in cuts for a, b in itertools.pairwise(cut)]


def _spread(column: np.ndarray, residual: np.ndarray, parts: Sequence[Linearized]) -> tuple[float, int]:
    """Variance of what each unit says of a parameter, in units of what the noise explains; its degrees of freedom."""
    cuts = units(parts)
    sizes = np.array([float(column[c] @ column[c]) for c in cuts])
    along = np.array([float(column[c] @ residual[c]) for c in cuts])
    felt = sizes > UNFELT * max(float(sizes.max()), 1e-300)
    free = int(felt.sum()) - 2
    return (float(np.sum(along[felt] ** 2 / sizes[felt])) / free, free) if free > 0 else (1.0, 0)
