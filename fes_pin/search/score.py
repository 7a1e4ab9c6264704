"""Score tests of causes in a fit: the gain of each if the model were linear in it.

C. R. Rao, Math. Proc. Camb. Phil. Soc. 44:50 (1948).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fes_pin.infer.covariance import least_squares_step
from fes_pin.infer.family import Family
from fes_pin.infer.levels import PARAMETER_PENALTY
from fes_pin.infer.problem import Linearized
from fes_pin.infer.projection import Projection, slices
from fes_pin.models.stage import Effect


@dataclass(frozen=True)
class Scored:
    """The score test of a cause in a fit.

    Attributes
    ----------
    effect
        The cause at (or next to) its null, with its shapes.
    gain
        Score statistic: drop in the sum of squares by the linearized effect. Where its amplitudes are each trial's own,
        the penalty of those beyond the amplitudes of a common effect is subtracted.
    amplitudes
        The linear estimate of its amplitudes.
    kept
        Share of the sensitivity's norm that the fitted parameters cannot reproduce.
    """

    effect: Effect
    gain: float
    amplitudes: dict[str, float]
    kept: float


def score_test(parts: Sequence[Linearized], probes: Sequence[tuple[Effect, np.ndarray]]) -> Scores:
    """Return the scores of causes in a fit, and their Gram matrix with the fitted parameters projected off.

    Causes whose amplitudes can differ between trials are scored both ways.

    Parameters
    ----------
    probes
        Causes with one choice of shapes, and their whitened sensitivities, all trials end to end, shape
        (m, amplitudes).
    """
    if not probes:
        return Scores([], np.zeros((0, 0)), [])
    projection = Projection(parts)
    made = projection.products([columns for _, columns in probes])
    blocks = slices(columns.shape[1] for _, columns in probes)
    each = [(e, b, float(made.before[b].sum())) for (e, _), b in zip(probes, blocks, strict=True)]
    out = [_score(e, made.gram[b, b], made.along[b], before) for e, b, before in each]
    if len(parts) > 1:
        out += [_each(projection, e, [c[:, b] for c in made.by_trial], before) for e, b, before in each if e.varies]
    return Scores(out, made.gram, blocks)


def _each(projection: Projection, one: Effect, partly: Sequence[np.ndarray], before: float) -> Scored:
    """Return the score of a cause with amplitudes of each trial's own: its columns, cut into trials, side by side.

    With c_i the columns of trial i, its own unknowns projected off, and B a basis of the parameters that all trials
    share, the Gram matrix of the projected columns is diag(c_i' c_i) - (c_i' B_i) (c_j' B_j)'.
    """
    count = partly[0].shape[1]
    gram = np.zeros((count * len(partly),) * 2)
    for k, columns in enumerate(partly):
        own = slice(count * k, count * (k + 1))
        gram[own, own] = columns.T @ columns
    trials = list(zip(partly, projection.trials, strict=True))
    shared = np.concatenate([columns.T @ projection.shared[rows] for columns, rows in trials])
    gram -= shared @ shared.T
    along = np.concatenate([columns.T @ projection.residual[rows] for columns, rows in trials])
    after = float(np.trace(gram))
    effect = type(one).of_each_trial(**{n: getattr(one, n) for n in one.shapes()})
    felt = np.diag(gram) > 1e-12 * np.diag(gram).max(initial=1e-300)
    if not after > 1e-18 * max(before, 1e-300) or not felt.any():
        return Scored(effect, 0.0, {}, 0.0)
    gram, along = gram[np.ix_(felt, felt)], along[felt]
    gain = float(along @ least_squares_step(gram, along)) - PARAMETER_PENALTY * max(len(along) - count, 0)
    return Scored(effect, gain, {}, float(np.sqrt(after / before)))


@dataclass(frozen=True)
class Scores:
    """Score tests of several causes.

    Attributes
    ----------
    scored
        One for each cause and choice of shapes, followed by one for each that can differ between trials.
    gram
        Shape (k, k): inner products of all columns, the fitted parameters projected off.
    blocks
        The rows of `gram` that belong to each of the former.
    """

    scored: list[Scored]
    gram: np.ndarray
    blocks: list[slice]

    def family(self, seed: int) -> Family:
        """Return the family of these tests; a form with amplitudes of each trial's own counts as one more test."""
        return Family(self.gram, self.blocks, seed, sum(s.effect.each_trial for s in self.scored))


def _score(effect: Effect, gram: np.ndarray, along: np.ndarray, before: float) -> Scored:
    names, info, null = effect.amplitudes(), effect.parameters(), effect.nulls()
    after = float(np.trace(gram))
    if not after > 1e-18 * max(before, 1e-300):
        return Scored(effect, 0.0, {n: null[n] for n in names}, 0.0)
    nulls = np.array([null[n] for n in names])
    lower, upper = np.array([[info[n].lower, info[n].upper] for n in names]).T
    amplitudes, gain = bounded_step(gram, along, lower - nulls, upper - nulls)
    values = dict(zip(names, (float(a) for a in amplitudes + nulls), strict=True))
    return Scored(effect, gain, values, float(np.sqrt(after / before)))


def bounded_step(gram: np.ndarray, along: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the step of amplitudes within bounds that a linear estimate gives, and its gain."""
    step = np.clip(least_squares_step(gram, along), lower, upper)
    return step, float(2.0 * along @ step - step @ gram @ step)


def best_by_effect(scored: Sequence[Scored]) -> Mapping[str, list[Scored]]:
    """Return the scored shapes of each effect, best first."""
    out: dict[str, list[Scored]] = {}
    for s in scored:
        out.setdefault(s.effect.name, []).append(s)
    return {n: sorted(v, key=lambda s: -s.gain) for n, v in out.items()}
