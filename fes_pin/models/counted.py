"""What a reading in counts tells of a Gaussian that was foretold: the interval that the count stands for.

With z = (y - h) / S of what is foretold, a reading's distance c = (y - h) / S and half a count d = q / (2 S),

    Z = Phi(c + d) - Phi(c - d),
    m = E[z | c - d < z < c + d] = (phi(c - d) - phi(c + d)) / Z,
    v = Var[z | ...] = 1 - m^2 + ((c - d) phi(c - d) - (c + d) phi(c + d)) / Z,

and with c at hand dm/dc = 1 - v. Of a count far below S they are those of a number: Z / (2 d) = phi(c), m = c, v = 0.

Source: Curry, Estimation and Control with Quantized Measurements, MIT Press 1970; Duan, Jilkov and Li, State estimation
with quantized measurements: approximate MMSE approach, 11th International Conference on Information Fusion, 2008.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from scipy.special import log_ndtr

LEAST = 1e-3
"""Half a count, in deviations, that a smaller one is taken for: below, the differences of a distribution are of
rounding, and what they tell is that of a number to the sixth digit."""
TAIL = 5.0
"""Deviations beyond which a Gaussian is told by its continued fraction, as if it fell as an exponential does: m to 1e-4
there, v within a twentieth."""
ROOT_TAU = float(np.sqrt(2.0 * np.pi))


def count_told(c: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """-2 log(Z / (2 d)), m and v, each of the shape of `c`."""
    side, c, d = np.where(c < 0.0, -1.0, 1.0), np.abs(c), np.maximum(d, LEAST)
    low, high = c - d, c + d
    beyond = log_ndtr(-low)
    logarithm = beyond + np.log(-np.expm1(log_ndtr(-high) - beyond))
    begin, end = (np.exp(-0.5 * x * x - logarithm) / ROOT_TAU for x in (low, high))
    m = begin - end
    v = np.clip(1.0 - m * m + low * begin - high * end, 0.0, 1.0)
    return -2.0 * (logarithm - np.log(2.0 * d)), side * m, v


def count_moments(c: Any, d: Any) -> tuple[Any, Any]:
    """m and v as expressions."""
    side, c, d = ca.if_else(c < 0.0, -1.0, 1.0), ca.fabs(c), ca.fmax(d, LEAST)
    low = c - d
    m, v = _inner(ca.fmin(low, TAIL), ca.fmin(low, TAIL) + 2.0 * d)
    far_m, far_v = _beyond(ca.fmax(low, TAIL), 2.0 * d)
    is_far = low > TAIL
    return side * ca.if_else(is_far, far_m, m), ca.if_else(is_far, far_v, v)


def _inner(low: Any, high: Any) -> tuple[Any, Any]:
    """m and v between two numbers of which the smaller is no larger than `TAIL`."""
    begin, end = (ca.exp(-0.5 * x * x) / ROOT_TAU for x in (low, high))
    between = 0.5 * (ca.erf(high / 2.0**0.5) - ca.erf(low / 2.0**0.5))
    m = (begin - end) / between
    return m, ca.fmin(ca.fmax(1.0 - m * m + (low * begin - high * end) / between, 0.0), 1.0)


def _beyond(low: Any, width: Any) -> tuple[Any, Any]:
    """m and v between low > `TAIL` and low + width, where a Gaussian falls as an exponential does."""
    rate = low + 2.0 / (low + 3.0 / low)
    grown = ca.exp(ca.fmin(rate * width, 200.0)) - 1.0
    m = low + 1.0 / rate - width / grown
    return m, ca.fmax(1.0 / rate**2 - (width / grown) ** 2 * (grown + 1.0), 0.0)
