"""Whether the bands of a gain filter mean what they say: NEES against the truth, and where honest means lie.

Source: Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, Wiley 2001, section
5.4.
"""

from __future__ import annotations

import math

import numpy as np
import scipy.stats

from fes_pin.paper.kalman import GainFilter


def nees(filter_: GainFilter, gain: float, time_constant_s: float) -> float:
    """Normalised estimation error squared of (alpha, beta) against the truth: two degrees of freedom."""
    alpha = math.exp(-filter_.dt / time_constant_s)
    truth = np.array([alpha, (1.0 - alpha) * gain * filter_.recruitment.force_scale_n])
    error = filter_.x[1:] - truth
    return float(error @ np.linalg.solve(filter_.p[1:, 1:], error))


def chi2_band(degrees: int, runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """Band of the mean of `runs` independent chi-squared numbers: where NEES and NIS of an honest filter lie."""
    tail = 0.5 * (1.0 - confidence)
    low, high = scipy.stats.chi2.ppf([tail, 1.0 - tail], degrees * runs) / runs
    return float(low), float(high)
