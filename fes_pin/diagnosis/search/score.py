"""Score tests of causes in a fit, one at a time and in pairs: the gain of each if the model were linear in it.

C. R. Rao, Math. Proc. Camb. Phil. Soc. 44:50 (1948).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fes_pin.diagnosis.search.library import Probe
from fes_pin.infer.covariance import least_squares_step
from fes_pin.infer.family import Family
from fes_pin.infer.levels import PARAMETER_PENALTY
from fes_pin.infer.problem import Linearized
from fes_pin.infer.projection import Projection, slices

RIDGE = 1e-8
"""Ridge of the scaled Gram matrix of two probes, which may be parallel."""


@dataclass(frozen=True)
class Scored:
    """The score test of a probe in a fit.

    Attributes
    ----------
    gain
        Score statistic: drop in the sum of squares by the linearized effect. Where its amplitudes are each trial's own,
        the penalty of those beyond the amplitudes of a common effect is subtracted.
    amplitudes
        The linear estimate of its amplitudes.
    kept
        Share of the sensitivity's norm that the fitted parameters cannot reproduce.
    """

    probe: Probe
    gain: float
    amplitudes: dict[str, float]
    kept: float


def score_test(parts: Sequence[Linearized], probes: Sequence[Probe]) -> Scores:
    """Return the scores of probes in a fit, and their Gram matrix with the fitted parameters projected off.

    Probes whose amplitudes can differ between trials are scored both ways.
    """
    if not probes:
        return Scores([], np.zeros((0, 0)), np.zeros(0), [])
    projection = Projection(parts)
    made = projection.products([p.columns for p in probes])
    blocks = slices(p.columns.shape[1] for p in probes)
    out = [
        _score(replace(p, columns=p.columns[:0]), made.gram[b, b], made.along[b], float(made.before[b].sum()))
        for p, b in zip(probes, blocks, strict=True)
    ]
    if len(parts) > 1:
        varying = [(p, b) for p, b in zip(probes, blocks, strict=True) if p.effect.varies]
        out += [_each(projection, p, [c[:, b] for c in made.by_trial], float(made.before[b].sum())) for p, b in varying]
    return Scores(out, made.gram, made.along, blocks)


def _each(projection: Projection, probe: Probe, partly: Sequence[np.ndarray], before: float) -> Scored:
    """Return the score of a probe with amplitudes of each trial's own: its columns, cut into trials, side by side.

    With c_i the columns of trial i, its own unknowns projected off, and B a basis of the parameters that all trials
    share, the Gram matrix of the projected columns is diag(c_i' c_i) - (c_i' B_i) (c_j' B_j)'.
    """
    count = probe.columns.shape[1]
    gram = np.zeros((count * len(partly),) * 2)
    for k, columns in enumerate(partly):
        own = slice(count * k, count * (k + 1))
        gram[own, own] = columns.T @ columns
    trials = list(zip(partly, projection.trials, strict=True))
    shared = np.concatenate([columns.T @ projection.shared[rows] for columns, rows in trials])
    gram -= shared @ shared.T
    along = np.concatenate([columns.T @ projection.residual[rows] for columns, rows in trials])
    after = float(np.trace(gram))
    effect = type(probe.effect).of_each_trial(**{n: getattr(probe.effect, n) for n in probe.effect.shapes()})
    probe = Probe(effect, probe.columns[:0])
    felt = np.diag(gram) > 1e-12 * np.diag(gram).max(initial=1e-300)
    if not after > 1e-18 * max(before, 1e-300) or not felt.any():
        return Scored(probe, 0.0, {}, 0.0)
    gram, along = gram[np.ix_(felt, felt)], along[felt]
    gain = float(along @ least_squares_step(gram, along)) - PARAMETER_PENALTY * max(len(along) - count, 0)
    return Scored(probe, gain, {}, float(np.sqrt(after / before)))


@dataclass(frozen=True)
class Scores:
    """Score tests of several probes.

    Attributes
    ----------
    scored
        One for each probe, without its columns, followed by one for each probe that can differ between trials.
    gram
        Shape (k, k): inner products of all columns, the fitted parameters projected off.
    along
        Shape (k,): their inner products with the residual.
    blocks
        The rows of `gram` that belong to each probe.
    """

    scored: list[Scored]
    gram: np.ndarray
    along: np.ndarray
    blocks: list[slice]

    def family(self, seed: int) -> Family:
        """Return the family of these tests; a form with amplitudes of each trial's own counts as one more test."""
        return Family(self.gram, self.blocks, seed, sum(s.probe.effect.each_trial for s in self.scored))


def _score(probe: Probe, gram: np.ndarray, along: np.ndarray, before: float) -> Scored:
    names, info = probe.effect.amplitudes(), probe.effect.parameters()
    after = float(np.trace(gram))
    if not after > 1e-18 * max(before, 1e-300):
        return Scored(probe, 0.0, {n: probe.effect.nulls()[n] for n in names}, 0.0)
    nulls = np.array([probe.effect.nulls()[n] for n in names])
    lower, upper = np.array([[info[n].lower, info[n].upper] for n in names]).T
    amplitudes, gain = bounded_step(gram, along, lower - nulls, upper - nulls)
    values = dict(zip(names, (float(a) for a in amplitudes + nulls), strict=True))
    return Scored(probe, gain, values, float(np.sqrt(after / before)))


def bounded_step(gram: np.ndarray, along: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the step of amplitudes within bounds that a linear estimate gives, and its gain."""
    step = np.clip(least_squares_step(gram, along), lower, upper)
    return step, float(2.0 * along @ step - step @ gram @ step)


def best_by_effect(scored: Sequence[Scored]) -> Mapping[str, list[Scored]]:
    """Return the scored shapes of each effect, best first."""
    out: dict[str, list[Scored]] = {}
    for s in scored:
        out.setdefault(s.probe.name, []).append(s)
    return {n: sorted(v, key=lambda s: -s.gain) for n, v in out.items()}


def best_pairs(scores: Scores, count: int) -> list[tuple[Scored, Scored]]:
    """Return the pairs of effects of largest joint score, best first, each pair of names once."""
    found: dict[tuple[str, str], tuple[Scored, Scored]] = {}
    first, second, gains = _pair_gains(scores)
    for k in np.argsort(-gains, kind="stable"):
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


def _pair_gains(scores: Scores) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return every pair of probes and its joint gain without bounds; each of shape (pairs,).

    Blocks are padded to one size with rows of the identity, which gain nothing.
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
    """Return the amplitudes at which two probes together explain most; None if they are out of bounds."""
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
