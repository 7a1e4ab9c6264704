"""Test for slips: a reading that jumps once within a trial, to a zero that it keeps until the trial ends."""

import math

import numpy as np

from fes_pin.identify.fit import Fit
from fes_pin.infer.distributions import pearson3_tail
from fes_pin.infer.levels import IDENTIFIABLE_SHARE
from fes_pin.infer.projection import Projection
from fes_pin.remainder.innovations import CLIP, Innovations, channels

TRIM = 0.15
"""Share of a trial at either end in which no jump is sought: Andrews, Tests for parameter instability and structural
change with unknown change point, Econometrica 61 (1993)."""
TIMES = 200
"""Times of each trial at which a jump is sought."""
DRAWS = 16
"""Simulated innovations of all trials; the scatter of their mean is allowed for."""


def slip_p_value(fitted: Fit, projection: Projection) -> float:
    """Return the p-value of the null that no reading jumps, at a time of each trial's own; corrected for channels.

    With e the innovations and s_t the whitened shape of a step of the reading at time t, the fitted parameters and the
    trial's unknowns projected off, z_t = s_t' e / |s_t| is the square root of the gain of the best step at t. The
    statistic is the sum over trials of the largest z_t^2, the generalised likelihood ratio of one step in each trial.
    White Gaussian innovations, projected in the same way, give its mean and the second and third cumulant of a trial's
    part; its tail is that of a gamma distribution of these moments, the scatter of the simulated mean included.

    The innovations have to be white down to the frequencies of a trial, and the noise must not have learned the jumps:
    it is to be of one long order, whatever criterion chooses orders; see `levels.FULL_NOISE`.

    Source: Basseville and Nikiforov, Detection of Abrupt Changes, Prentice Hall 1993, section 2.4.3.
    """
    measured = np.clip(projection.residual, -CLIP, CLIP)
    noise = projection(np.random.default_rng(0).standard_normal((len(measured), DRAWS)))
    vectors = np.column_stack([measured, noise])
    shared = projection.shared.T @ vectors
    found = [_one(np.array([_largest(e, projection, vectors, shared) for e in group])) for group in channels(fitted)]
    return min(1.0, len(found) * min(found))


def _largest(one: Innovations, projection: Projection, vectors: np.ndarray, shared: np.ndarray) -> np.ndarray:
    """Return the largest z_t^2 of one trial along each of some vectors, shape (k,).

    Parameters
    ----------
    shared
        Inner products of the vectors with the basis that all trials share.
    """
    count, rows = len(one.trial), projection.trials[one.number]
    columns = np.zeros((rows.stop - rows.start, TIMES))
    at = count * np.linspace(TRIM, 1.0 - TRIM, TIMES)
    columns[one.rows - rows.start] = one.whitened((np.arange(count)[:, None] >= at).astype(float))
    left, along = projection.within(one.number, columns)
    squares = np.einsum("mt,mt->t", left, left) - np.einsum("rt,rt->t", along, along)
    felt = squares > IDENTIFIABLE_SHARE**2 * np.einsum("mt,mt->t", columns, columns)
    z = left[:, felt].T @ vectors[rows] - along[:, felt].T @ shared
    return np.asarray(np.max(z**2 / squares[felt, None], axis=0, initial=0.0))


def _one(largest: np.ndarray) -> float:
    """Return the p-value of one channel from the largest z_t^2 of its trials, shape (trials, 1 + draws)."""
    statistic, null = float(largest[:, 0].sum()), largest[:, 1:]
    trials, draws = null.shape
    apart = null - null.mean(axis=1, keepdims=True)
    variance = float(np.sum(apart**2)) / (draws - 1)
    if not variance > 0.0:
        return 1.0
    away = (statistic - float(null.mean(axis=1).sum())) / math.sqrt(variance * (1.0 + 1.0 / draws))
    return pearson3_tail(away, max(trials * float(np.mean(apart**3)) / variance**1.5, 1e-3))
