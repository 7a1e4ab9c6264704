"""Score tests of every item by which a grouped model may be extended."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fes_pin.contrasts.grouped import Grouped, by_group
from fes_pin.data.trial import Trial
from fes_pin.infer.covariance import covariance_of
from fes_pin.infer.family import Family
from fes_pin.infer.keys import Key
from fes_pin.infer.levels import PARAMETER_PENALTY
from fes_pin.infer.problem import Unknowns
from fes_pin.infer.projection import BlockColumns, Projection, slices
from fes_pin.infer.spread import ByUnit, Spread, units, usual_spread
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect
from fes_pin.search.library import Library
from fes_pin.search.score import LEAST_KEPT, bounded_step, kept_of
from fes_pin.search.starts import near_null, started
from fes_pin.workers import in_parallel

FITTED = 2
"""Parameters that are fitted along an item: the mean of all trials, and that of one group."""


@dataclass(frozen=True)
class ItemScore:
    """The score test of an item in a set.

    Attributes
    ----------
    effect
        The cause with its start values; None for a parameter, or a cause, that the group's model has.
    gain
        Score statistic: predicted gain in twice the log-likelihood.
    degrees
        Number of its parameters.
    kept
        Share of its sensitivity that the parameters of the set cannot reproduce.
    deviation
        Standard deviation of its first amplitude.
    start
        Start values of parameters of the model, by path.
    spread
        Spread of its first amplitude between trials.
    """

    item: Key
    effect: Effect | None
    gain: float
    degrees: int
    kept: float
    deviation: float
    start: Mapping[str, float]
    spread: Spread

    @property
    def net_gain(self) -> float:
        """Gain minus the penalty of its parameters."""
        return self.gain - PARAMETER_PENALTY * self.degrees


@dataclass(frozen=True)
class ItemScores:
    """The scores of items, and the Gram matrix of the columns of changes with the parameters of the set projected off.

    Attributes
    ----------
    gram
        Shape (k, k).
    blocks
        The rows of `gram` of each change.
    """

    scored: list[ItemScore]
    gram: np.ndarray
    blocks: list[slice]

    @cached_property
    def usual_spread(self) -> Spread:
        """The usual spread of the items: see `infer.spread`."""
        return usual_spread([s.spread for s in self.scored], len({s.item.name for s in self.scored}))


@dataclass(frozen=True)
class _Probe:
    """An item with one choice of shapes.

    Attributes
    ----------
    amplitudes
        For each amplitude by name, its value without the item, and its bounds.
    pieces
        Whitened sensitivities to them of the trials of each group that the item concerns.
    """

    item: Key
    effect: Effect | None
    amplitudes: Mapping[str, tuple[float, float, float]]
    pieces: Mapping[str, np.ndarray]


class Screen:
    """Score tests of the items by which grouped models of some trials may be extended.

    Parameters
    ----------
    nominal
        The rig, without effects.
    trials
        Trials by group.
    library
        The causes, on all trials together.
    """

    def __init__(self, nominal: Model, trials: Mapping[str, Sequence[Trial]], library: Library) -> None:
        self._nominal, self._trials, self._library = nominal, trials, library
        self._effects = [e for e in library.effects if library.felt(e)]
        self._by_group = {g: Library(nominal, own, library.effects) for g, own in trials.items()}
        self._scores: dict[int, tuple[Grouped, ItemScores]] = {}

    def scores(self, base: Grouped) -> ItemScores:
        """Return the scores of every item that a set does not have."""
        if id(base) not in self._scores:
            self._scores[id(base)] = base, self._scored(base)
        return self._scores[id(base)][1]

    def family(self, base: Grouped, seed: int) -> Family:
        """Return the family of the tests of all changes, of which a set has some."""
        scores = self.scores(base)
        return Family(scores.gram, scores.blocks, seed, len(base.changes))

    def _scored(self, base: Grouped) -> ItemScores:
        ends = slices(sum(len(p.residual) for p in own) for own in by_group(base.parts, self._trials).values())
        rows = dict(zip(self._trials, ends, strict=True))
        probes, columns = list(self._probes(base, rows)), BlockColumns(Projection(base.parts), rows)
        places = [{g: columns.added(g, piece) for g, piece in p.pieces.items()} for p in probes]
        by_unit = zip(*(x.T for x in columns.by_unit(places, units(base.parts))), strict=True)
        spreads = [ByUnit.of_products(sizes, along).spread(FITTED) for sizes, along in by_unit]
        each = zip(probes, places, spreads, strict=True)
        scored = [_score(p, *columns.products(place), spread) for p, place, spread in each]
        changes = [place for p, place in zip(probes, places, strict=True) if p.item.group]
        return ItemScores(scored, *columns.gram(changes))

    def _probes(self, base: Grouped, rows: Mapping[str, slice]) -> Iterator[_Probe]:
        """Yield every item that a set does not have; `rows` are those of each group."""
        for item in self._differing(base):
            yield _own(base, item, rows[str(item.group)])
        unknowns = by_group(base.unknowns, self._trials)
        wanted = [e for e in self._effects if Key(e.name) not in base.items]
        for many in in_parallel(lambda e: list(self._of_cause(e, base, unknowns)), wanted):
            yield from many

    def _differing(self, base: Grouped) -> Iterator[Key]:
        """Yield parameters and causes of all groups as items with a value of their own in one group.

        Of two groups it is the second that has it, as both choices give the same model.
        """
        groups = list(self._trials)
        free = groups[1:] if len(groups) == 2 else groups
        for name in (*self._nominal.fitted_parameters(), *sorted(i.name for i in base.items if not i.group)):
            taken = [i.group for i in base.items if i.name == name and i.group]
            if len(taken) < len(groups) - 1:
                yield from (Key(name, group=g) for g in free if g not in taken)

    def _of_cause(self, kind: type[Effect], base: Grouped, unknowns: Mapping[str, Unknowns]) -> Iterator[_Probe]:
        """Yield a cause in all groups that lack it, and in each of them; in the form that other groups have, if any.

        If one group alone lacks it, that group has no item of its own: with it the cause acts in all.
        """
        has = [g for g in self._trials if Key(kind.name, group=g) in base.items]
        lacks = [g for g in self._trials if g not in has]
        wanted: list[tuple[Key, list[str]]] = [(Key(kind.name), lacks)]
        wanted += [(Key(kind.name, group=g), [g]) for g in lacks if len(lacks) > 1]
        for one in [_at_null(base.grouped.models[has[0]], kind)] if has else self._library.grid(kind):
            pieces = {g: self._sensitivities(one, base, g, unknowns[g]) for g in lacks}
            info = one.parameters()
            amplitudes = {n: (float(info[n].null or 0.0), info[n].lower, info[n].upper) for n in one.amplitudes()}
            for item, groups in wanted:
                yield _Probe(item, one, amplitudes, {g: pieces[g] for g in groups})

    def _sensitivities(self, one: Effect, base: Grouped, group: str, unknowns: Unknowns) -> np.ndarray:
        """Return sensitivities of the trials of a group to the amplitudes of a cause, whitened as in a fit."""
        at = (base.grouped.models[group], base.weights.noise[group], unknowns)
        parts = self._by_group[group].sensitivities(one, *at)
        shrinks = by_group(base.shrinks, self._trials)[group]
        return np.concatenate([s.shrunk(p) for s, p in zip(shrinks, parts, strict=True)] if shrinks else parts)


def _at_null(model: Model, kind: type[Effect]) -> Effect:
    """Return a cause of a model at its null."""
    effect = next(e for e in model.effects if e.name == kind.name)
    nulls: dict[str, Any] = {n: near_null(kind, n) for n in effect.amplitudes()}
    return replace(effect, **nulls)


def _own(base: Grouped, item: Key, rows: slice) -> _Probe:
    """Return a parameter, or a cause's amplitudes, in one group alone."""
    model, group = base.grouped, str(item.group)
    effects = (e for e in model.models[group].effects if e.name == item.name)
    names = [f"{e.name}.{n}" for e in effects for n in e.amplitudes()] or [item.name]
    paths = [model.path(n, group) for n in names]
    every = np.concatenate([p.jacobian for p in base.parts])[rows]
    values, info = model.parameters(), model.parameter_info()
    amplitudes = {n: (values[p], info[p].lower, info[p].upper) for n, p in zip(names, paths, strict=True)}
    return _Probe(item, None, amplitudes, {group: every[:, [model.free.index(p) for p in paths]]})


def _score(one: _Probe, gram: np.ndarray, along: np.ndarray, norms: np.ndarray, spread: Spread) -> ItemScore:
    """Return the score of an item from its columns with the parameters of the set projected off.

    Parameters
    ----------
    gram, along
        Inner products of the projected columns, with each other and with the residual.
    norms
        Of its columns before.
    spread
        Spread of its first amplitude between trials.
    """
    kept = kept_of(gram, norms)
    degrees = len(one.amplitudes) if one.effect is None else len(one.effect.fitted_parameters())
    if kept < LEAST_KEPT:
        return ItemScore(one.item, one.effect, 0.0, degrees, 0.0, np.inf, {}, spread)
    nulls, low, high = np.array(list(one.amplitudes.values())).T
    step, gain = bounded_step(gram, along, low - nulls, high - nulls)
    deviation = math.sqrt(covariance_of(gram, np.ones(len(step), dtype=bool))[0, 0])
    values = dict(zip(one.amplitudes, (nulls + step).tolist(), strict=True))
    if one.effect is not None:
        return ItemScore(one.item, started(one.effect, values), gain, degrees, kept, deviation, {}, spread)
    start = {str(Key(n, group=one.item.group)): v or one.amplitudes[n][0] for n, v in values.items()}
    return ItemScore(one.item, None, gain, degrees, kept, deviation, start, spread)
