"""One model for several groups of trials, in which some parameters have a value of their own in one group."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from fes_pin.contrasts.repeats import RepeatedProblem, Shrink, scatter
from fes_pin.data.trial import Trial
from fes_pin.identify.fit import Fit
from fes_pin.identify.likelihood import is_simulated
from fes_pin.identify.problem import products_of
from fes_pin.infer.keys import Key
from fes_pin.infer.levels import PARAMETER_PENALTY, SEPARABLE
from fes_pin.infer.noise import Noise
from fes_pin.infer.optimum import Optimum
from fes_pin.infer.problem import Linearized, Unknowns, whitened_sse
from fes_pin.infer.scoring import Evaluation, NoisyProblem, Point
from fes_pin.models.model import Model
from fes_pin.models.parameters import ParameterInfo
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.models.rigs.base import Rig
from fes_pin.models.stage import Effect

T = TypeVar("T")


@dataclass(frozen=True)
class GroupedModel:
    """A model for each group; a parameter of the same name is the same in all, but for those in `own`.

    A parameter's name is its path, with ":group" behind it where the group has a value of its own.

    Attributes
    ----------
    models
        By group, in order.
    own
        Pairs of path and group.
    items
        Its causes and changes in addition to the nominal model.
    """

    models: Mapping[str, Model]
    own: frozenset[tuple[str, str]] = frozenset()
    items: frozenset[Key] = frozenset()

    @property
    def rig(self) -> Rig:
        """The rig of the first group: all are of one kind."""
        return next(iter(self.models.values())).rig

    def path(self, name: str, group: str) -> str:
        """Return the path of a parameter of a group's model."""
        return str(Key(name, group=group)) if (name, group) in self.own else name

    def parameters(self) -> dict[str, float]:
        """Return the value of every parameter, by its path."""
        return {self.path(n, g): v for g, m in self.models.items() for n, v in m.parameters().items()}

    def parameter_info(self) -> dict[str, ParameterInfo]:
        """Unit, null, bounds and scale, by path."""
        return {self.path(n, g): i for g, m in self.models.items() for n, i in m.parameter_info().items()}

    @cached_property
    def free(self) -> tuple[str, ...]:
        """Paths of the fitted parameters."""
        return tuple(dict.fromkeys(self.path(n, g) for g, m in self.models.items() for n in m.fitted_parameters()))

    def own_unknowns(self) -> tuple[str, ...]:
        """Return the unknowns of trials that belong to effects: none, as amplitudes belong to groups here."""
        return ()

    def of(self, group: str, values: Mapping[str, float]) -> dict[str, float]:
        """Return the values of one group's model."""
        return {n: values[self.path(n, group)] for n in self.models[group].parameters()}

    def with_parameters(self, values: Mapping[str, float]) -> GroupedModel:
        """Return the same model with other values."""
        full = {**self.parameters(), **values}
        models = {g: m.with_parameters(self.of(g, full)) for g, m in self.models.items()}
        return replace(self, models=models)

    def structure(self) -> tuple[str, ...]:
        """The rig, and the effects of each group."""
        return tuple(f"{g}: {n}" for g, m in self.models.items() for n in m.structure())

    def having(self, items: Collection[Key], new: Sequence[Effect] = ()) -> GroupedModel:
        """The same rig with these items alone.

        A group that has a cause of its own has all its parameters for itself; where all groups have the
        cause, its amplitudes alone.

        Parameters
        ----------
        new
            Causes with their start values, for groups that do not have them yet.
        """
        models, own = {}, set[tuple[str, str]]()
        for group, model in self.models.items():
            wanted = {i.name for i in items if i.group in ("", group)}
            known = [e for e in model.effects if e.name in wanted]
            known += [e for e in new if e.name in wanted and e.name not in {k.name for k in known}]
            models[group] = Model(model.rig, tuple(known))
            own |= {(n, group) for i in items if i.group == group for n in _differing(i, known, Key(i.name) in items)}
        return _agreed(GroupedModel(models, frozenset(own), frozenset(items)))


def _differing(item: Key, effects: Sequence[Effect], is_common: bool) -> list[str]:
    """Names of the parameters that an item gives a group of its own."""
    return [
        f"{e.name}.{n}" for e in effects if e.name == item.name for n in (e.amplitudes() if is_common else e.common())
    ] or [item.name]


def _agreed(model: GroupedModel) -> GroupedModel:
    """The same with one value of every parameter that groups share: that of the first group that has it."""
    groups = reversed(list(model.models.items()))
    return model.with_parameters({model.path(n, g): v for g, m in groups for n, v in m.parameters().items()})


@dataclass(frozen=True, eq=False)
class Weights:
    """What whitens the trials of each group. Groups have their own noise: a noisier day is no change of the rig.

    Attributes
    ----------
    noise
        Process and measurement noise by group.
    deviations
        Standard deviation of a nominal parameter between the trials of a group, in its unit, by name.
    """

    noise: Mapping[str, StateSpaceNoise]
    deviations: Mapping[str, float] = field(default_factory=dict)


class GroupedProblem(NoisyProblem):
    """A grouped model on the trials of all groups.

    Parameters
    ----------
    model
        Its structure.
    trials
        By group, in the order of the model's groups.
    weights
        Noise of each group, and how much repeats scatter.
    """

    def __init__(self, model: GroupedModel, trials: Mapping[str, Sequence[Trial]], weights: Weights) -> None:
        self.model, self.free, self._by_group = model, model.free, trials
        self.deviations = weights.deviations
        own = {g: (m, trials[g], weights.noise[g], weights.deviations) for g, m in model.models.items()}
        self.parts = {g: RepeatedProblem(*given) for g, given in own.items()}
        self.trials = tuple(t for p in self.parts.values() for t in p.trials)
        self.unknown_names = tuple(dict.fromkeys(n for p in self.parts.values() for n in p.unknown_names))
        self.limits = {model.path(n, g): v for g, p in self.parts.items() for n, v in p.limits.items()}

    @property
    def weights(self) -> Weights:
        """Noise of each group, and how much repeats scatter."""
        return Weights({g: p.noise for g, p in self.parts.items()}, self.deviations)

    @property
    def noise(self) -> dict[str, Noise]:
        """Noise by column and group."""
        return {str(Key(n, group=g)): v for g, p in self.parts.items() for n, v in p.noise.items()}

    def start_unknowns(self) -> Unknowns:
        """The unknowns of each trial as its first samples suggest."""
        return [u for p in self.parts.values() for u in p.start_unknowns()]

    @property
    def noise_parameters(self) -> dict[str, float]:
        """Parameters of the process and measurement noise that may change, by name and group."""
        return {str(Key(n, group=g)): v for g, p in self.parts.items() for n, v in p.noise_parameters.items()}

    @property
    def noise_limits(self) -> dict[str, tuple[float, float]]:
        """Bounds of these parameters."""
        return {str(Key(n, group=g)): v for g, p in self.parts.items() for n, v in p.noise_limits.items()}

    def set_noise(self, parameters: Mapping[str, float]) -> None:
        """Change parameters of the noise, in place."""
        for g, p in self.parts.items():
            p.set_noise(_of_group(parameters, g))

    def evaluate(self, points: Sequence[Point]) -> list[Evaluation]:
        """Return one-step predictions of all trials at each of several points, group after group."""
        cut = [by_group(unknowns, self._by_group) for _, unknowns, _ in points]
        each = []
        for g, p in self.parts.items():
            pairs = zip(points, cut, strict=True)
            each.append(p.evaluate([(self.model.of(g, v), own[g], _of_group(r, g)) for (v, _, r), own in pairs]))
        return [Evaluation.joined(one) for one in zip(*each, strict=True)]

    def noise_step(self, values: Mapping[str, float], unknowns: Unknowns) -> float:
        """Improve the noise of each group, in place; return by how much the cost falls.

        Without process noise the scatter of repeats is estimated too; process noise would explain it.
        """
        own = by_group(unknowns, self._by_group)
        gained = float(sum(p.noise_step(self.model.of(g, values), own[g]) for g, p in self.parts.items()))
        calm = all(p.is_simulated for p in self.parts.values())
        return gained + self._scatter_step(values, unknowns) if calm else gained

    def _scatter_step(self, values: Mapping[str, float], unknowns: Unknowns) -> float:
        """Estimate the scatter of repeats again, in place; return by how much the cost falls."""
        cut, names = by_group(unknowns, self._by_group), Model(self.model.rig).fitted_parameters()
        plain = {g: p.plain(self.model.of(g, values), cut[g]) for g, p in self.parts.items()}
        columns = [p.columns(one, names) for g, p in self.parts.items() for one in plain[g]]
        found = scatter([one for g, many in plain.items() for one in self._spread(g, many)], columns, names)
        before, self.deviations = self._cost(plain), found
        for part in self.parts.values():
            part.deviations = found
        return before - self._cost(plain)

    def _cost(self, plain: Mapping[str, Sequence[Linearized]]) -> float:
        """Return the cost of trials that were linearized without scatter."""
        return float(sum(whitened_sse(p.scattered(plain[g])) for g, p in self.parts.items()))

    def shrinks(self, values: Mapping[str, float], unknowns: Unknowns) -> list[Shrink]:
        """Return the whitening of each trial by the scatter of repeats; none where nothing scatters."""
        cut, known = by_group(unknowns, self._by_group), {g: p for g, p in self.parts.items() if p.deviations}
        return [s for g, p in known.items() for s in p.shrinks(p.plain(self.model.of(g, values), cut[g]))]

    @cached_property
    def products(self) -> list[tuple[int, int]]:
        """Places in `free` of shapes and of the amplitudes that they multiply."""
        return products_of(self.free, self.model.parameter_info())

    @property
    def is_final(self) -> bool:
        """Whether a descent ends without other slopes."""
        return all(p.is_final for p in self.parts.values())

    @property
    def batch(self) -> int:
        """Number of points that `costs` evaluates in one run."""
        return max(p.batch for p in self.parts.values())

    def costs(self, points: Sequence[tuple[Mapping[str, float], Unknowns]]) -> list[float]:
        """Return a lower bound of the cost: where parameters scatter, the cost itself needs sensitivities."""
        return [-np.inf] * len(points) if self.deviations else super().costs(points)

    def linearize(self, values: Mapping[str, float], unknowns: Unknowns) -> list[Linearized]:
        """Return whitened residuals and sensitivities of all trials, group after group."""
        cut = by_group(unknowns, self._by_group)
        each = {g: p.linearize(self.model.of(g, values), cut[g]) for g, p in self.parts.items()}
        return [one for g, many in each.items() for one in self._spread(g, many)]

    def _spread(self, group: str, parts: Sequence[Linearized]) -> list[Linearized]:
        """Return trials of a group with the parameters and unknowns of all groups."""
        out, own = [], self.parts[group]
        at = [self.free.index(self.model.path(n, group)) for n in own.free]
        unknown = [self.unknown_names.index(n) for n in own.unknown_names]
        for one in parts:
            jacobian = np.zeros((len(one.residual), len(self.free)))
            local = np.zeros((len(one.residual), len(self.unknown_names)))
            jacobian[:, at], local[:, unknown] = one.jacobian, one.local
            out.append(replace(one, jacobian=jacobian, local=local))
        return out


def by_group(rows: Iterable[T], trials: Mapping[str, Sequence[Trial]]) -> dict[str, list[T]]:
    """Return values of all trials, groups end to end, by group."""
    left = iter(rows)
    return {g: list(itertools.islice(left, len(many))) for g, many in trials.items()}


def _of_group(parameters: Mapping[str, float], group: str) -> dict[str, float]:
    """Return the parameters of a group's noise, by name."""
    split = ((Key.of(name), v) for name, v in parameters.items())
    return {key.name: v for key, v in split if key.group == group}


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class Grouped(Fit):
    """A fitted grouped model; its `sse` is twice the negative log-likelihood up to a constant.

    Attributes
    ----------
    grouped
        The fitted model.
    weights
        Noise of each group, and scatter of repeats.
    shrinks
        Whitening of each trial by the scatter of repeats, all groups end to end; empty where nothing scatters.
    """

    grouped: GroupedModel
    weights: Weights
    shrinks: Sequence[Shrink]

    @classmethod
    def of(cls, problem: GroupedProblem, found: Optimum) -> Grouped:
        """Return the fit of a grouped problem at its optimum."""
        model, shrinks = problem.model.with_parameters(found.values), problem.shrinks(found.values, found.unknowns)
        ended = {**vars(found), "model": model, "parameters": model.parameters(), "grouped": model}
        return cls(**ended, trials=problem.trials, noise=problem.noise, weights=problem.weights, shrinks=shrinks)

    @property
    def items(self) -> frozenset[Key]:
        """Its causes and changes in addition to the nominal model."""
        return self.grouped.items

    @property
    def criterion(self) -> float:
        """`sse` with a penalty for each parameter, also of process noise, and for each change.

        A common cause is preferred to a change that explains as much: an error of the model in all groups is no change.
        """
        random = 2 * sum(len(n.acting) for n in self.weights.noise.values()) + len(self.weights.deviations)
        return self.sse + PARAMETER_PENALTY * (self.degrees + random) + SEPARABLE * len(self.changes)

    @property
    def changes(self) -> tuple[Key, ...]:
        """The items that differ in one group, by name."""
        return tuple(sorted((i for i in self.items if i.group), key=str))

    @property
    def common(self) -> tuple[str, ...]:
        """Causes of all groups, except those that differ in one."""
        differ = {i.name for i in self.changes}
        return tuple(sorted(i.name for i in self.items if not i.group and i.name not in differ))

    @property
    def is_driven(self) -> bool:
        """Whether predictions are one step ahead: there is process noise, or a motion is imposed."""
        return not all(is_simulated(n, self.trials) for n in self.weights.noise.values())

    @property
    def repeats(self) -> dict[str, float]:
        """Deviation of each nominal parameter between trials, as a share of the first group's value."""
        values = next(iter(self.grouped.models.values())).parameters()
        return {n: s / abs(values[n]) for n, s in self.weights.deviations.items() if values[n]}

    def certainty(self, change: Key) -> float:
        """Return by how many deviations one group differs from the others, in the amplitude where that is most.

        Amplitudes that are not identified count as equal.
        """
        group, own = str(change.group), self.grouped.models[str(change.group)]
        names = [f"{e.name}.{n}" for e in own.effects if e.name == change.name for n in e.amplitudes()]
        return max(self._apart(n, group) for n in names or [change.name])

    @np.errstate(invalid="ignore")
    def _apart(self, name: str, group: str) -> float:
        """Return the difference of a parameter of one group from its value in another, or its null, in deviations."""
        model, here = self.grouped, self.grouped.path(name, group)
        there = [model.path(name, g) for g, m in model.models.items() if g != group and name in m.parameters()][:1]
        other = self.values[there[0]] if there else model.models[group].parameter_info()[name].null or 0.0
        weights = np.array([(n == here) - float(n in there) for n in self.free])
        felt = weights != 0.0
        variance = float(weights[felt] @ self.covariance[np.ix_(felt, felt)] @ weights[felt])
        return abs(self.values[here] - other) / math.sqrt(variance) if 0.0 < variance < math.inf else 0.0

    def leaning(self, moved: np.ndarray) -> float:
        """Return the part of the squares of a change that depends on the scatter of repeats.

        Parameters
        ----------
        moved
            Change of the residuals, shape (m,), all trials end to end.
        """
        ends = np.cumsum([len(p.residual) for p in self.parts])[:-1]
        pieces = np.split(moved, ends) if self.shrinks else []
        return sum(s.leaning(one) for s, one in zip(self.shrinks, pieces, strict=True))
