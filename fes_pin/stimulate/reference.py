"""A wanted angle as a stream of numbers, made smooth enough to be followed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from fes_pin.stimulate.observer import PULSE_S

HALF_WINDOW = 4
"""Pulses that a step is spread over, to each side: 89 ms, about two time constants of the muscle."""
LOOKAHEAD = HALF_WINDOW + 2
"""Pulses ahead that the window reads: the smoothed angle's second difference one pulse ahead needs them."""
_LENGTH = 2 * LOOKAHEAD


def _weights() -> np.ndarray:
    """Angle, rate and acceleration now and a pulse ahead from the window, shape (6, _LENGTH)."""
    bell = np.hanning(2 * HALF_WINDOW + 3)[1:-1]
    bell /= bell.sum()
    smooth = np.zeros((4, _LENGTH))
    for row in range(4):  # smoothed angle a pulse ago, now, one and two ahead
        smooth[row, row : row + len(bell)] = bell
    before, now, ahead, beyond = smooth
    h = PULSE_S
    return np.array(
        [
            now,
            (ahead - before) / (2 * h),
            (ahead - 2 * now + before) / h**2,
            ahead,
            (beyond - now) / (2 * h),
            (beyond - 2 * ahead + now) / h**2,
        ]
    )


class ReferenceWindow:
    """The reference from 5 pulses ago to 6 ahead.

    Parameters
    ----------
    rest_rad
        What it holds at first.
    """

    def __init__(self, rest_rad: float) -> None:
        self.values = np.full(_LENGTH, rest_rad)
        self.last = rest_rad
        self.weights = _weights()

    def take(self, reference: float | Sequence[float], lowest: float, highest: float) -> None:
        """Go on by one pulse; see `PositionController.step`. Values are held between two angles."""
        values = self.values
        values[:-1] = values[1:]
        if not isinstance(reference, (list, tuple, np.ndarray)):
            values[-1] = self._good(reference, self.last, lowest, highest)
            self.last = float(values[-1])
            return
        before = float(values[LOOKAHEAD - 2])
        for k, value in enumerate(list(reference)[: LOOKAHEAD + 1]):
            before = values[LOOKAHEAD - 1 + k] = self._good(value, before, lowest, highest)
        self.last = float(values[-1])

    @staticmethod
    def _good(value: Any, before: float, lowest: float, highest: float) -> float:
        """A value held between two angles; the one before it if it is none."""
        good = isinstance(value, (float, int)) and -math.inf < value < math.inf
        return min(max(float(value) if good and abs(value) < 1e9 else before, lowest), highest)

    def now(self) -> list[float]:
        """Angle, rate and acceleration now, then the same a pulse ahead; rad and s."""
        return (self.weights @ self.values).tolist()
