"""Test for deviations at the same time of every trial, whatever the stimulus, against differences between trials."""

from collections.abc import Sequence

import numpy as np

from fes_pin.infer.distributions import f_tail
from fes_pin.remainder.innovations import CLIP, autocorrelation

SCALES_S = (0.0, 0.03, 0.08, 0.2, 0.5)
"""Lengths over which the innovations are averaged, s; 0 averages nothing."""
LENGTHS = 16
"""Least number of such lengths in a trial."""
FEWEST = 3
"""Least number of trials from which differences are estimated."""


def repeated_p_value(innovations: Sequence[np.ndarray], dt: float) -> float:
    """Return the p-value of the mean of the innovations over trials, against differences between trials.

    With z_i the innovations of trial i averaged over a length and m their mean over T trials,
    T sum_t m_t^2 / (sum_it (z_it - m_t)^2 / (T - 1)) is compared with Fisher's F of k and k (T - 1) degrees,
    k = n / sum_s rho_s^2, rho the autocorrelation of z. Whatever the spectrum of the noise, it is the same in both. The
    smallest p-value is corrected for the number of lengths.

    Parameters
    ----------
    innovations
        One array for each trial, from the same time of each.
    dt
        Time step, s.
    """
    if len(innovations) < FEWEST:
        return 1.0
    size = min(map(len, innovations))
    e = np.clip([one[:size] for one in innovations], -CLIP, CLIP)
    found = [_one(e, count) for s in SCALES_S if size >= LENGTHS * (count := max(1, round(s / dt)))]
    return min([1.0, *(len(found) * p for p in found)])


def _one(e: np.ndarray, count: int) -> float:
    z = np.stack([np.convolve(one, np.ones(count) / count, "valid") for one in e])
    trials, mean = len(z), z.mean(axis=0)
    apart = z - mean
    degrees = len(mean) / float(np.sum(autocorrelation(list(apart)) ** 2))
    ratio = trials * float(mean @ mean) / max(float(np.sum(apart**2)) / (trials - 1), 1e-300)
    return f_tail(ratio, degrees, degrees * (trials - 1))
