"""A wanted angle as a stream of numbers, made smooth enough to be followed."""

from __future__ import annotations

from collections.abc import Sequence
from operator import mul

import numpy as np

from fes_pin.control.dynamics import PULSE_S, number

HALF_WINDOW = 4
"""Pulses that a step is spread over, to each side: 89 ms, about two time constants of the muscle."""
LOOKAHEAD = HALF_WINDOW + 2
"""Pulses ahead that the window reads: the smoothed angle's second difference one pulse ahead needs them."""
_LENGTH = 2 * LOOKAHEAD
_BELL = np.hanning(2 * HALF_WINDOW + 3)[1:-1]
BELL: list[float] = (_BELL / _BELL.sum()).tolist()
"""Weights of the smoothing, by pulse; they add up to 1."""


class ReferenceWindow:
    """The reference from 5 pulses ago to 6 ahead.

    Parameters
    ----------
    rest_rad
        What it holds at first.
    """

    def __init__(self, rest_rad: float) -> None:
        self.values = [rest_rad] * _LENGTH
        self.last = rest_rad

    def take(self, reference: float | Sequence[float], lowest: float, highest: float) -> None:
        """Go on by one pulse; see `PositionController.step`. Values are held between two angles; one that is none is
        replaced by the one before it.
        """
        values = self.values
        values.append(values[-1])
        del values[0]
        if isinstance(reference, np.ndarray) and reference.ndim == 1:
            reference = reference[: LOOKAHEAD + 1].tolist()
        several = isinstance(reference, (list, tuple))
        coming = reference[: LOOKAHEAD + 1] if several else [reference]  # type: ignore[index]
        k = LOOKAHEAD - 1 if several else _LENGTH - 1
        before = values[k - 1] if several else self.last
        for value in coming:
            good = value if type(value) is float else number(value)
            if -1e9 < good < 1e9:
                before = lowest if good < lowest else highest if good > highest else good
            else:
                before = lowest if before < lowest else highest if before > highest else before
            values[k] = before
            k += 1
        self.last = values[-1]

    def now(self) -> tuple[float, float, float, float, float, float]:
        """Angle, rate and acceleration now, then the same a pulse ahead; rad and s."""
        n = len(BELL)
        before, now, ahead, beyond = [sum(map(mul, BELL, self.values[k : k + n])) for k in range(4)]
        half, square = 0.5 / PULSE_S, 1.0 / PULSE_S**2
        return (
            now,
            half * (ahead - before),
            square * (ahead - 2.0 * now + before),
            ahead,
            half * (beyond - now),
            square * (beyond - 2.0 * ahead + now),
        )
