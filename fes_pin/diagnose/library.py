"""The candidate causes near a fitted model: sensitivities to each effect at its null, over its shapes."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.diagnose.workers import in_parallel
from fes_pin.identify.fit import PARAMETER_PRICE, Fit
from fes_pin.identify.noise import NoiseModel
from fes_pin.identify.problem import Linearized, Problem, measured_columns
from fes_pin.models.effects import effects_for
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect

TINY = 0.02
"""Share of an amplitude's scale at which a one-sided effect is linearized: next to its null, on its own side."""
RIDGE = 1e-8
"""Added to the scaled Gram matrix of two probes, which may be the same."""


@dataclass(frozen=True)
class Probe:
    """One effect with one choice of shapes, linearized at its null.

    Attributes
    ----------
    effect
        The effect at (or next to) its null, with its shapes.
    columns
        Shape (m, amplitudes): whitened sensitivities, all trials end to end.
    """

    effect: Effect
    columns: np.ndarray

    @property
    def name(self) -> str:
        """Of the cause."""
        return self.effect.name


class Library:
    """The causes that a rig can have, ready to be linearized on trials."""

    def __init__(self, model: Model, trials: Sequence[Trial]) -> None:
        self.effects = effects_for(model.rig.name)
        self.model, self.trials = Model(model.rig), tuple(trials)
        self.measured = measured_columns(model, trials)
        self._problems: dict[str, Problem] = {}

    def grid(self, effect: type[Effect]) -> list[Effect]:
        """The effect at its null with every combination of its shapes."""
        grids = effect.grids(self.measured)
        shapes = effect.shapes()
        start: dict[str, Any] = {n: near_null(effect, n) for n in effect.amplitudes()}
        return [
            effect(**{**start, **dict(zip(shapes, values, strict=True))})
            for values in itertools.product(*(grids[n] for n in shapes))
        ]

    def probes(self, fitted: Fit, noise: NoiseModel, exclude: Sequence[str] = ()) -> list[Probe]:
        """Every effect, linearized at the nominal parameters of a fit.

        The effects that the fit has already are left out of the linearization, as `exclude` is of the result: their
        influence on another effect's sensitivity is of second order.
        """
        nominal = Model(fitted.model.rig)
        wanted = [e for e in self.effects if e.name not in exclude and self._felt(e)]
        return [p for group in in_parallel(lambda e: self._probe(e, nominal, fitted, noise), wanted) for p in group]

    def silent(self) -> tuple[str, ...]:
        """Names of the effects that act in none of the trials: of a joint, where all are isometric."""
        return tuple(e.name for e in self.effects if not self._felt(e))

    def _felt(self, effect: type[Effect]) -> list[int]:
        """The trials in which an effect acts."""
        rig = self.model.rig
        return [i for i, t in enumerate(self.trials) if effect.signal in rig.changeable(t.kind, rig.input_columns(t))]

    def _probe(self, effect: type[Effect], nominal: Model, fitted: Fit, noise: NoiseModel) -> list[Probe]:
        """The effect with every choice of its shapes; only the trials in which it acts are simulated."""
        felt = self._felt(effect)
        if effect.name not in self._problems:
            free = tuple(f"{effect.name}.{n}" for n in effect.amplitudes())
            self._problems[effect.name] = Problem(
                nominal + effect.absent(), [self.trials[i] for i in felt], noise, free
            )
        problem = self._problems[effect.name]
        problem.noise = noise
        ends = np.cumsum([0, *(problem.rows(t) for t in self.trials)])
        out = []
        for one in self.grid(effect):
            columns = np.zeros((ends[-1], len(problem.free)))
            parts = problem.linearize((nominal + one).parameters(), [fitted.unknowns[i] for i in felt])
            for i, part in zip(felt, parts, strict=True):
                columns[ends[i] : ends[i + 1]] = part.jacobian
            out.append(Probe(one, columns))
        return out


def near_null(effect: type[Effect], name: str) -> float:
    """The null of an amplitude, or next to it where that is a bound."""
    info = effect.parameters()[name]
    assert info.null is not None
    one_sided = info.null in {info.lower, info.upper}
    return info.null + (TINY * info.scale if one_sided else 0.0)


@dataclass(frozen=True)
class Scored:
    """A probe, measured against a fit.

    Attributes
    ----------
    gain
        Drop in the sum of squares that the linearized effect promises; where its amplitudes are each trial's own, less
        the price of each that it has beyond those of a common effect.
    amplitudes
        The linear estimate of its amplitudes.
    kept
        Share of the sensitivity's norm that the fitted parameters do not take up.
    """

    probe: Probe
    gain: float
    amplitudes: dict[str, float]
    kept: float


class Projection:
    """What is left of whitened vectors beside a fit's own parameters and its trials' unknowns."""

    def __init__(self, parts: Sequence[Linearized]) -> None:
        self.residual = np.concatenate([p.residual for p in parts])
        self._bases, self._slices, self._trials = [], [], []
        at = 0
        for part in parts:
            rows = slice(at, at + len(part.residual))
            at = rows.stop
            self._trials.append(rows)
            if (felt := part.local.any(axis=0)).any():
                self._bases.append(np.linalg.qr(_scaled(part.local[:, felt]))[0])
                self._slices.append(rows)
        jacobian = np.concatenate([p.jacobian for p in parts])
        self._basis = _basis(self._without_locals(jacobian))
        self.residual = self(self.residual[:, None])[:, 0]

    def _without_locals(self, columns: np.ndarray) -> np.ndarray:
        out = np.array(columns, dtype=float)
        for basis, rows in zip(self._bases, self._slices, strict=True):
            out[rows] -= basis @ (basis.T @ out[rows])
        return out

    def __call__(self, columns: np.ndarray) -> np.ndarray:
        """Columns of shape (m, k) without the part that the fit could take up."""
        return self._without_shared(self._without_locals(columns))

    def taken(self, rows: slice) -> list[np.ndarray]:
        """Orthonormal vectors, cut to rows of one trial, that are taken from columns which are zero elsewhere."""
        own = [
            basis[rows.start - where.start : rows.stop - where.start]
            for basis, where in zip(self._bases, self._slices, strict=True)
            if where.start <= rows.start and rows.stop <= where.stop
        ]
        return [*own, self._basis[rows]]

    def _without_shared(self, columns: np.ndarray) -> np.ndarray:
        return columns - self._basis @ (self._basis.T @ columns)

    def score(self, probes: Sequence[Probe]) -> Scores:
        """The promises of probes, and the Gram matrix of what is left of them.

        Those that can be other in each trial are scored both ways.
        """
        stacked = np.concatenate([p.columns for p in probes], axis=1)
        stacked = np.where(np.isfinite(stacked), stacked, 0.0)
        partly = self._without_locals(stacked)
        left = self._without_shared(partly)
        before, gram, along = np.einsum("mi,mi->i", stacked, stacked), left.T @ left, left.T @ self.residual
        out, blocks, at = [], [], 0
        for probe in probes:
            block = slice(at, at + probe.columns.shape[1])
            at = block.stop
            blocks.append(block)
            slim = replace(probe, columns=probe.columns[:0])
            out.append(_score(slim, gram[block, block], along[block], float(before[block].sum())))
        if len(self._trials) > 1:
            out += [
                self._own(p, stacked[:, b], partly[:, b]) for p, b in zip(probes, blocks, strict=True) if _varies(p)
            ]
        return Scores(out, gram, along, blocks)

    def _own(self, probe: Probe, columns: np.ndarray, partly: np.ndarray) -> Scored:
        """A probe with amplitudes of each trial's own: its columns, cut into trials, side by side.

        With c_i the columns of trial i beside its own unknowns and B the basis of what all trials share, the Gram
        matrix of what is left is diag(c_i' c_i) - (c_i' B_i) (c_j' B_j)'.
        """
        count = columns.shape[1]
        gram = np.zeros((count * len(self._trials),) * 2)
        for k, rows in enumerate(self._trials):
            own = slice(count * k, count * (k + 1))
            gram[own, own] = partly[rows].T @ partly[rows]
        shared = np.concatenate([partly[rows].T @ self._basis[rows] for rows in self._trials])
        gram -= shared @ shared.T
        along = np.concatenate([partly[rows].T @ self.residual[rows] for rows in self._trials])
        before, after = float(np.sum(columns**2)), float(np.trace(gram))
        effect = type(probe.effect).of_each_trial(**{n: getattr(probe.effect, n) for n in probe.effect.shapes()})
        probe = Probe(effect, probe.columns[:0])
        felt = np.diag(gram) > 1e-12 * np.diag(gram).max(initial=1e-300)
        if not after > 1e-18 * max(before, 1e-300) or not felt.any():
            return Scored(probe, 0.0, {}, 0.0)
        gram, along = gram[np.ix_(felt, felt)], along[felt]
        scale = 1.0 / np.sqrt(np.diag(gram))
        x = np.linalg.lstsq(gram * np.outer(scale, scale), along * scale, rcond=1e-10)[0]
        gain = float((along * scale) @ x) - PARAMETER_PRICE * max(len(along) - count, 0)
        return Scored(probe, gain, {}, float(np.sqrt(after / before)))


@dataclass(frozen=True)
class Scores:
    """Probes, scored together.

    Attributes
    ----------
    scored
        One for each probe, whose columns are dropped, and after those one for each that can be other in each trial.
    gram
        Shape (k, k): inner products of what the fit leaves of all columns.
    along
        Shape (k,): their inner products with the residual.
    blocks
        The rows of `gram` that belong to each probe.
    """

    scored: list[Scored]
    gram: np.ndarray
    along: np.ndarray
    blocks: list[slice]


def _score(probe: Probe, gram: np.ndarray, along: np.ndarray, before: float) -> Scored:
    names, info = probe.effect.amplitudes(), probe.effect.parameters()
    after = float(np.trace(gram))
    if not after > 1e-18 * max(before, 1e-300):
        return Scored(probe, 0.0, {n: float(info[n].null or 0.0) for n in names}, 0.0)
    nulls = np.array([info[n].null for n in names], dtype=float)
    lower, upper = np.array([[info[n].lower, info[n].upper] for n in names]).T
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram), 1e-300))
    amplitudes = scale * np.linalg.lstsq(gram * np.outer(scale, scale), along * scale, rcond=1e-10)[0]
    amplitudes = np.clip(amplitudes, lower - nulls, upper - nulls)
    gain = float(2.0 * along @ amplitudes - amplitudes @ gram @ amplitudes)
    values = dict(zip(names, (float(a) for a in amplitudes + nulls), strict=True))
    return Scored(probe, gain, values, float(np.sqrt(after / before)))


def _varies(probe: Probe) -> bool:
    return probe.effect.varies


def _scaled(columns: np.ndarray) -> np.ndarray:
    norms = np.linalg.norm(columns, axis=0)
    return columns / np.where(norms > 0, norms, 1.0)


def _basis(columns: np.ndarray, tolerance: float = 1e-7) -> np.ndarray:
    """Orthonormal basis of the span of columns, shape (m, rank)."""
    if not columns.shape[1]:
        return columns
    scaled = _scaled(columns)
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    good = values > tolerance**2 * max(values[-1], 1e-300) * 1e4
    rough = (scaled @ vectors[:, good]) / np.sqrt(values[good])
    return np.linalg.qr(rough)[0] if good.any() else columns[:, :0]


def best_by_effect(scored: Sequence[Scored]) -> Mapping[str, list[Scored]]:
    """For each effect its scored shapes, best first."""
    out: dict[str, list[Scored]] = {}
    for s in scored:
        out.setdefault(s.probe.name, []).append(s)
    return {n: sorted(v, key=lambda s: -s.gain) for n, v in out.items()}


def best_pairs(scores: Scores, count: int) -> list[tuple[Scored, Scored]]:
    """Pairs of effects whose linearizations together promise most, best first, each pair of names once."""
    found: dict[tuple[str, str], tuple[Scored, Scored]] = {}
    first, second, promise = _pair_promises(scores)
    for k in np.argsort(-promise, kind="stable"):
        i, j = int(first[k]), int(second[k])
        one, other = scores.scored[i], scores.scored[j]
        key = (other.probe.name, one.probe.name)
        if key in found or one.probe.name == other.probe.name or not (one.kept > 0 and other.kept > 0):
            continue
        inside = _inside(scores, i, j)
        if inside is not None:
            found[key] = (replace(one, amplitudes=inside[0]), replace(other, amplitudes=inside[1]))
            if len(found) == count:
                break
    return list(found.values())


def _pair_promises(scores: Scores) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Every pair of probes and what both promise together, bounds aside; each of shape (pairs,).

    Blocks are filled up to one size with rows of the identity, which promise nothing.
    """
    size, rows = max(b.stop - b.start for b in scores.blocks), len(scores.along)
    gram = np.eye(rows + 2 * size)
    gram[:rows, :rows] = scores.gram
    along = np.concatenate([scores.along, np.zeros(2 * size)])
    spare = [np.arange(rows + k * size, rows + (k + 1) * size) for k in range(2)]
    where = [np.stack([np.r_[b, fill][:size] for b in scores.blocks]) for fill in spare]
    first, second = np.tril_indices(len(scores.blocks), -1)
    at = np.concatenate([where[0][first], where[1][second]], axis=1)
    inner, toward = gram[at[:, :, None], at[:, None, :]], along[at]
    scale = 1.0 / np.sqrt(np.maximum(np.einsum("kii->ki", inner), 1e-300))
    scaled = inner * scale[:, :, None] * scale[:, None, :] + RIDGE * np.eye(2 * size)
    x = scale * np.linalg.solve(scaled, (toward * scale)[:, :, None])[:, :, 0]
    return first, second, 2.0 * np.einsum("ki,ki->k", toward, x) - np.einsum("ki,kij,kj->k", x, inner, x)


def _inside(scores: Scores, i: int, j: int) -> tuple[dict[str, float], dict[str, float]] | None:
    """Amplitudes at which two probes together explain most; None if they lie outside their bounds."""
    rows = np.r_[scores.blocks[i], scores.blocks[j]]
    gram, along = scores.gram[np.ix_(rows, rows)], scores.along[rows]
    keys = [(k, n) for k in (i, j) for n in scores.scored[k].probe.effect.amplitudes()]
    info = [scores.scored[k].probe.effect.parameters()[n] for k, n in keys]
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram), 1e-300))
    scaled = gram * np.outer(scale, scale) + RIDGE * np.eye(len(rows))
    x = scale * np.linalg.solve(scaled, along * scale)
    nulls = np.array([f.null or 0.0 for f in info])
    if any(not f.lower <= v + z <= f.upper for f, v, z in zip(info, x, nulls, strict=True)):
        return None
    values = {key: float(v + z) for key, v, z in zip(keys, x, nulls, strict=True)}
    one, other = ({n: v for (k, n), v in values.items() if k == which} for which in (i, j))
    return one, other
