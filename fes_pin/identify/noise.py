"""Measurement noise: autoregressive, one model for each measured channel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

ORDERS = (0, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48)
"""Orders tried. Sensor noise is whitened by a few; random torque under white sensor noise is slow and needs 24 to 48: on
the ankle, order 12 leaves 2.2 times too much power below 0.5 Hz, order 24 none, and a test would take it for a cause."""


COEFFICIENT_PRICE = 4.0
"""Twice the log-likelihood that one more coefficient must earn: two standard deviations; Akaike's 2 keeps too many."""


@dataclass(frozen=True)
class Noise:
    """Autoregressive noise e_t = ar_1 e_(t-1) + ... + ar_p e_(t-p) + innovation, Gaussian.

    Attributes
    ----------
    innovation_std
        Standard deviation of the innovation, unit of the channel.
    ar
        Coefficients, shape (p,).
    std
        Standard deviation of the noise itself.
    """

    innovation_std: float
    ar: tuple[float, ...] = ()
    std: float = 0.0

    def whiten(self, values: np.ndarray) -> np.ndarray:
        """Innovations in units of their standard deviation.

        Parameters
        ----------
        values
            Shape (n, ...): residuals, or sensitivities that go with them.

        Returns
        -------
        ndarray
            Shape (n - p, ...): the first p samples only start the filter.
        """
        p = len(self.ar)
        out = values[p:] / self.innovation_std
        for lag, coefficient in enumerate(self.ar, start=1):
            out -= (coefficient / self.innovation_std) * values[p - lag : len(values) - lag]
        return out


def estimate_noise(residuals: Sequence[np.ndarray], used: int = 0) -> Noise:
    """Fit autoregressive noise to the residuals of one channel, by least squares.

    Parameters
    ----------
    residuals
        One array of shape (n,) for each trial.
    used
        Degrees of freedom that a fit has taken out of the residuals already.
    """
    total = sum(len(r) for r in residuals)
    shortest = min(len(r) for r in residuals)
    orders = [p for p in ORDERS if p <= shortest // 10]
    order_limit = orders[-1]
    lagged = [_lags(r, order_limit) for r in residuals if len(r) > 2 * order_limit + 2]
    gram = np.sum([m.T @ m for m in lagged], axis=0)
    count = sum(len(m) for m in lagged)
    best: tuple[float, int, np.ndarray, float] | None = None
    for p in orders:
        ar = (
            scipy.linalg.solve(gram[1 : p + 1, 1 : p + 1] + _ridge(gram, p), gram[1 : p + 1, 0], assume_a="pos")
            if p
            else np.zeros(0)
        )
        rss = max(float(gram[0, 0] - gram[0, 1 : p + 1] @ ar), 1e-300)
        criterion = count * np.log(rss / count) + COEFFICIENT_PRICE * p
        if best is None or criterion < best[0]:
            best = (criterion, p, ar, rss)
    assert best is not None
    innovation = float(np.sqrt(best[3] / max(count - best[1] - used, 1)))
    std = float(np.sqrt(sum(float(r @ r) for r in residuals) / max(total - used, 1)))
    return Noise(max(innovation, 1e-12), tuple(float(a) for a in best[2]), std)


def _lags(residual: np.ndarray, order: int) -> np.ndarray:
    """Shape (n - order, order + 1): the residual and its past."""
    n = len(residual)
    return np.stack([residual[order - k : n - k] for k in range(order + 1)], axis=1)


def _ridge(gram: np.ndarray, p: int) -> np.ndarray:
    """Just enough to keep a noiseless channel solvable."""
    return 1e-12 * gram[0, 0] * np.eye(p)


NoiseModel = Mapping[str, Noise]
"""Noise by output column."""
