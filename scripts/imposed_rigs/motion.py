"""Imposed motions and what is random about a reading, for all rigs alike."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

Function = Callable[[float], float]


@dataclass(frozen=True)
class Motion:
    """A sum of sines: position and its derivatives at any time."""

    centre: float
    sizes: np.ndarray
    rates: np.ndarray
    phases: np.ndarray

    def at(self, time: np.ndarray | float, order: int = 0) -> np.ndarray:
        """The derivative of an order, shape of `time`."""
        angle = np.multiply.outer(np.asarray(time, dtype=float), self.rates) + self.phases + 0.5 * np.pi * order
        return np.sin(angle) @ (self.sizes * self.rates**order) + (self.centre if order == 0 else 0.0)


def drawn(centre: float, reach: float, slowest_hz: float, fastest_hz: float, rng: np.random.Generator) -> Motion:
    """Three sines of an amplitude `reach` together."""
    sizes = rng.uniform(0.3, 1.0, size=3)
    rates = 2.0 * np.pi * np.sort(rng.uniform(slowest_hz, fastest_hz, size=3))
    sizes = sizes / (1.0 + rates / rates[0])
    return Motion(centre, reach * sizes / sizes.sum(), rates, rng.uniform(0.0, 2.0 * np.pi, size=3))


def wandering(count: int, dt: float, std: float, time_s: float, rng: np.random.Generator) -> np.ndarray:
    """A first-order random process, shape (count,), that begins as it goes on."""
    keep = float(np.exp(-dt / time_s))
    shocks = std * np.sqrt(1.0 - keep**2) * rng.standard_normal(count)
    shocks[0] = std * rng.standard_normal()
    return lfilter([1.0], [1.0, -keep], shocks)
