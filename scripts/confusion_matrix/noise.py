"""Noise of three families: white, autoregressive, and coloured by a random torque or as ARMA(2, 1)."""

from __future__ import annotations

import numpy as np
import scipy.signal

FAMILIES = ("white", "ar1", "process")
LEVEL = {"angle_rad": 2e-3, "force_n": 0.2, "position": 2e-3}
"""Standard deviation of one sample, by column."""
TORQUE_NM = 4e-3
"""Standard deviation of the random torque on the paper's ankle, held from sample to sample."""


def sensor_noise(rng: np.random.Generator, family: str, column: str, count: int, colour: float) -> np.ndarray:
    """Noise of one channel of one trial at the family's level, shape (count,).

    Parameters
    ----------
    colour
        From 0 to 1, one number for a study: where between the family's limits it lies.
    """
    return LEVEL[column] * _filtered(rng, count, *_polynomials(family, colour))


def _polynomials(family: str, colour: float) -> tuple[list[float], list[float]]:
    """Numerator and denominator of the family's filter."""
    if family == "ar1":
        return [1.0], [1.0, -(0.6 + 0.3 * colour)]
    if family == "arma":
        return [1.0, 0.4], [1.0, -(1.1 + 0.3 * colour), 0.3 + 0.2 * colour]
    return [1.0], [1.0]


def _filtered(rng: np.random.Generator, count: int, b: list[float], a: list[float]) -> np.ndarray:
    """A stationary ARMA sequence of variance 1."""
    response = scipy.signal.lfilter(b, a, np.r_[1.0, np.zeros(2000)])
    drawn = scipy.signal.lfilter(b, a, rng.standard_normal(count + 500))[500:]
    return drawn / np.sqrt(np.sum(response**2))


def random_torque(rng: np.random.Generator, count: int, weight: float, colour: float) -> np.ndarray:
    """A random torque, held from sample to sample, N m, shape (count,).

    Parameters
    ----------
    weight
        Of the torque against that of the paper's ankle.
    colour
        From 0 (white) to 1 (correlated over some 50 ms).
    """
    pole = 0.9 * max(0.0, 2.0 * colour - 1.0)
    size = weight * TORQUE_NM * (0.6 + 0.8 * (colour % 0.5)) * np.sqrt((1.0 - pole) / (1.0 + pole))
    return size * _filtered(rng, count, [1.0], [1.0, -pole])
