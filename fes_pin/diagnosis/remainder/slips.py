"""Test for slips: a reading that jumps once within a trial, to a zero that it keeps until the trial ends."""

from __future__ import annotations

import math

import numpy as np
import scipy.fft

from fes_pin.diagnosis.remainder.innovations import CLIP, Innovations, each_channel
from fes_pin.identify.fit import Fit
from fes_pin.infer.distributions import pearson3_tail
from fes_pin.infer.levels import IDENTIFIABLE_SHARE
from fes_pin.infer.noise import Noise
from fes_pin.infer.projection import Projection

TRIM = 0.15
"""Share of a trial at either end in which no jump is sought: Andrews, Tests for parameter instability and structural
change with unknown change point, Econometrica 61 (1993)."""
DRAWS = 16
"""Simulated innovations of all trials; the scatter of their mean is allowed for."""


def slip_p_value(fitted: Fit, projection: Projection, seed: int = 0) -> float:
    """Return the p-value of the null that no reading jumps, at a time of each trial's own; corrected for channels.

    With e the innovations and s_t the whitened shape of a step of the reading at time t, the fitted parameters and the
    trial's unknowns projected off, z_t = s_t' e / |s_t| is the square root of the gain of the best step at t. The
    statistic is the sum over trials of the largest z_t^2, the generalised likelihood ratio of one step in each trial.
    White Gaussian innovations, projected in the same way, give its mean and the second and third cumulant of a trial's
    part; its tail is that of a gamma distribution of these moments, the scatter of the simulated mean included.

    A deviation that is slow without a jump raises the statistic as well, if less.

    The innovations have to be white down to the frequencies of a trial, and the noise must not have learned the jumps:
    it is to be of one long order, whatever criterion chooses orders; see `open_set.FULL_NOISE`.

    Source: Basseville and Nikiforov, Detection of Abrupt Changes, Prentice Hall 1993, section 2.4.3.
    """
    groups: dict[str, list[_Scan]] = {}
    for one in each_channel(fitted):
        scan = _Scan(one, projection)
        if scan.felt.any():
            groups.setdefault(one.channel, []).append(scan)
    if not groups:
        return 1.0
    measured = np.clip(projection.residual, -CLIP, CLIP)[:, None]
    noise = projection(np.random.default_rng(seed).standard_normal((len(measured), DRAWS)))
    return min(1.0, len(groups) * min(_one(scans, measured, noise) for scans in groups.values()))


def _one(scans: list[_Scan], measured: np.ndarray, noise: np.ndarray) -> float:
    """Return the p-value of one channel."""
    statistic = sum(float(s.largest(measured)[0]) for s in scans)
    null = np.stack([s.largest(noise) for s in scans])
    trials, draws = null.shape
    apart = null - null.mean(axis=1, keepdims=True)
    variance = trials * float(np.sum(apart**2)) / (trials * (draws - 1))
    third = trials * float(np.mean(apart**3))
    away = (statistic - float(null.mean(axis=1).sum())) / math.sqrt(variance * (1.0 + 1.0 / draws))
    return pearson3_tail(away, max(third / variance**1.5, 1e-3))


class _Scan:
    """Steps of the reading at all times of one channel of one trial.

    With h the step response of the whitening filter, s_t is h from time t on; its inner product with a vector v is the
    sum from t on of what the filter's adjoint makes of v.
    """

    def __init__(self, one: Innovations, projection: Projection) -> None:
        self.rows, self.noise = one.rows, one.noise
        count = len(one.rows)
        edge = math.ceil(TRIM * count)
        self.inside = slice(edge, max(count - edge, edge))
        taps = np.cumsum(_filter(one.noise))
        step = np.r_[taps, np.full(max(count - len(taps), 0), taps[-1])][:count]
        norms = np.cumsum(step**2)[::-1]
        taken = sum(np.sum(self._along(b) ** 2, axis=1) for b in projection.taken(one.rows))
        left = (norms - taken)[self.inside]
        self.felt = left > IDENTIFIABLE_SHARE**2 * norms[self.inside]
        self.scale = np.where(self.felt, 1.0 / np.sqrt(np.where(self.felt, left, 1.0)), 0.0)

    def largest(self, columns: np.ndarray) -> np.ndarray:
        """Return the largest z_t^2 of each column of shape (m, k), all trials end to end."""
        z = self._along(columns[self.rows])[self.inside] * self.scale[:, None]
        return np.asarray((z**2).max(axis=0))

    def _along(self, columns: np.ndarray) -> np.ndarray:
        """Return inner products of the columns, shape (n, k), with steps at each of the n times."""
        taps = _filter(self.noise)
        size = scipy.fft.next_fast_len(len(columns) + len(taps), real=True)
        spectrum = np.fft.rfft(columns, size, axis=0) * np.fft.rfft(taps, size).conj()[:, None]
        adjoint = np.fft.irfft(spectrum, size, axis=0)[: len(columns)]
        return np.cumsum(adjoint[::-1], axis=0)[::-1]


def _filter(noise: Noise) -> np.ndarray:
    """Return the whitening filter, up to scale."""
    return np.r_[1.0, -np.array(noise.ar)]
