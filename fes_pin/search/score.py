"""Score tests of causes in a fit: the gain of each if the model were linear in it.

C. R. Rao, Math. Proc. Camb. Phil. Soc. 44:50 (1948).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fes_pin.infer.covariance import least_squares_step
from fes_pin.infer.family import Family
from fes_pin.infer.levels import PARAMETER_PENALTY
from fes_pin.infer.problem import Linearized
from fes_pin.infer.projection import BlockColumns, Projection
from fes_pin.models.stage import Effect

LEAST_KEPT = 1e-6
"""Share of its norm that a sensitivity must keep to be scored: below it is rounding."""


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
    trials = dict(enumerate(projection.trials))
    columns = BlockColumns(projection, trials)
    places = [{k: columns.added(k, whole[rows]) for k, rows in trials.items()} for _, whole in probes]
    each = [(effect, place) for (effect, _), place in zip(probes, places, strict=True)]
    scored = [_score(effect, *columns.products(place)) for effect, place in each]
    if len(parts) > 1:
        scored += [_each_trial(columns, effect, place) for effect, place in each if effect.varies]
    return Scores(scored, *columns.gram(places))


def _each_trial(columns: BlockColumns[int], one: Effect, place: Mapping[int, slice]) -> Scored:
    """Return the score of a cause with amplitudes of each trial's own: a column of each amplitude in each trial."""
    alone = [{k: at} for k, at in place.items()]
    gram, _ = columns.gram(alone)
    made = [columns.products(own) for own in alone]
    along, norms = (np.concatenate([one[j] for one in made]) for j in (1, 2))
    effect = type(one).of_each_trial(**{n: getattr(one, n) for n in one.shapes()})
    felt, kept = np.diag(gram) > LEAST_KEPT**2 * np.diag(gram).max(initial=1e-300), kept_of(gram, norms)
    if kept < LEAST_KEPT or not felt.any():
        return Scored(effect, 0.0, {}, 0.0)
    gram, along = gram[np.ix_(felt, felt)], along[felt]
    penalty = PARAMETER_PENALTY * max(len(along) - len(norms) // len(alone), 0)
    return Scored(effect, float(along @ least_squares_step(gram, along)) - penalty, {}, kept)


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


def _score(effect: Effect, gram: np.ndarray, along: np.ndarray, norms: np.ndarray) -> Scored:
    names, info, null = effect.amplitudes(), effect.parameters(), effect.nulls()
    kept = kept_of(gram, norms)
    if kept < LEAST_KEPT:
        return Scored(effect, 0.0, {n: null[n] for n in names}, 0.0)
    nulls = np.array([null[n] for n in names])
    lower, upper = np.array([[info[n].lower, info[n].upper] for n in names]).T
    amplitudes, gain = bounded_step(gram, along, lower - nulls, upper - nulls)
    return Scored(effect, gain, dict(zip(names, (amplitudes + nulls).tolist(), strict=True)), kept)


def kept_of(gram: np.ndarray, norms: np.ndarray) -> float:
    """Return the share of the norm of columns that is kept once fitted parameters are projected off."""
    return math.sqrt(max(float(np.trace(gram)), 0.0) / max(float(norms @ norms), 1e-300))


def bounded_step(gram: np.ndarray, along: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the step of amplitudes within bounds that a linear estimate gives, and its gain."""
    step = np.clip(least_squares_step(gram, along), lower, upper)
    return step, float(2.0 * along @ step - step @ gram @ step)


def best_by_effect(scored: Sequence[Scored]) -> Mapping[str, list[Scored]]:
    """Return the scored shapes of each effect, best first."""
    ordered, names = sorted(scored, key=lambda s: -s.gain), [s.effect.name for s in scored]
    return {n: [s for s in ordered if s.effect.name == n] for n in dict.fromkeys(names)}
