"""Notices a loop that swings by itself.

A frame, a tendon or a nerve outside of eq. (1) can turn the feedback into an oscillator. Between two changes of sign
the tracking error of such a loop covers more area than its noise can, again and again, while the reference turns
seldom. Source: Haegglund, A control-loop performance monitor, Control Engineering Practice 3 (1995) 1543-1551; that
the reference is watched too is of this project.
"""

import math

from fes_pin.control.dynamics import PULSE_S

AMPLITUDE_RAD = math.radians(0.4)
"""A sine as large as this, and larger ones, count as swings."""
SLOWEST_HZ = 1.0
"""Slower ones are left to the feedback: references move so."""
SWINGS = 8
"""Half periods in a row that make an oscillation."""
PAUSE_PULSES = 90
"""2 s after an oscillation was found, in which a calmer loop comes to rest."""


class _Turns:
    """Counts how often a number turns back by more than `AMPLITUDE_RAD`."""

    def __init__(self) -> None:
        self.low, self.high, self.rising, self.count = math.inf, -math.inf, False, 0

    def take(self, value: float) -> None:
        self.low, self.high = min(self.low, value), max(self.high, value)
        if self.rising and value < self.high - AMPLITUDE_RAD:
            self.rising, self.low, self.count = False, value, self.count + 1
        elif not self.rising and value > self.low + AMPLITUDE_RAD:
            self.rising, self.high, self.count = True, value, self.count + 1


class OscillationWatch:
    """Counts large half periods of an error, one sample to a pulse.

    Attributes
    ----------
    frequency_hz
        Of the last oscillation that was found; 0 before.
    """

    def __init__(self) -> None:
        self.frequency_hz = 0.0
        self.turns = _Turns()
        self.area, self.pulses, self.pause = 0.0, 0, 0
        self._start()

    def _start(self) -> None:
        self.count = self.lasted = self.turns.count = 0

    def take(self, wanted_rad: float, angle_rad: float) -> bool:
        """Note where the joint should be and is; True when it has swung about that `SWINGS` times in a row."""
        if self.pause:
            self.pause -= 1
            return False
        error = wanted_rad - angle_rad
        self.turns.take(wanted_rad)
        if self.area * error < 0.0:
            self._half_period()
            self.area, self.pulses = 0.0, 0
        self.area += error
        self.pulses += 1
        if self.count < SWINGS:
            return False
        found = self.turns.count <= SWINGS // 2
        if found:
            self.frequency_hz = 0.5 * self.count / (self.lasted * PULSE_S)
            self.pause = PAUSE_PULSES
        self._start()
        return found

    def _half_period(self) -> None:
        # half a period of a sine has the mean 2 / pi of its height
        large = abs(self.area) > 2.0 / math.pi * AMPLITUDE_RAD * self.pulses
        if large and self.pulses * PULSE_S < 0.5 / SLOWEST_HZ:
            self.count, self.lasted = self.count + 1, self.lasted + self.pulses
        else:
            self._start()
