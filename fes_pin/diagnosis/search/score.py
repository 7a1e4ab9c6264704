"""Score tests of causes in a fit: the gain of each if the model were linear in it.

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
        return Scores([], np.zeros((0, 0)), [])
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
    return Scores(out, made.gram, blocks)


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
    blocks
        The rows of `gram` that belong to each probe.
    """

    scored: list[Scored]
    gram: np.ndarray
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
