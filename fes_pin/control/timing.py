"""Whether a controller is called once a pulse."""

import math
import time

from fes_pin.control.dynamics import PULSE_S
from fes_pin.control.faults import BAD_READINGS
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import number

PAUSE_S = BAD_READINGS * PULSE_S
"""Time between two readings from which on it is a pause, 0.13 s: so many missing readings in a row are a fault, too."""
CLOCK_PAUSE_S = 1.0
"""The same by the computer's clock, which other programs hold up: a muscle lets go within 0.2 s."""
AHEAD_S, FORGOTTEN = 0.5 * PULSE_S, 0.1
"""How far calls may run ahead of the pulses, and the share of it that is forgotten with each: jitter of half a pulse,
and a timer of 22 ms in place of 22.2. Limits count pulses: calls twice as fast would give twice the charge."""


class PulseClock:
    """Times of the calls of a controller, as they are stated or by the computer's clock."""

    def __init__(self) -> None:
        self.last: tuple[bool, float] | None = None
        self.ahead_s = 0.0

    def pause_s(self, time_s: float | None) -> float:
        """Note a call; the time in s since the last one if that was a pause, else 0.

        Raises
        ------
        InputError
            For a stated time that is none, or calls that come faster than pulses; the call does not count.
        """
        stated = time_s is not None
        now = number(time_s, "time_s") if stated else time.monotonic()
        gap = now - self.last[1] if self.last and self.last[0] == stated else PULSE_S
        ahead = max((1.0 - FORGOTTEN) * self.ahead_s + PULSE_S - gap, 0.0) if stated else 0.0
        if ahead > AHEAD_S:
            raise InputError(
                f"expected one call per pulse, every {PULSE_S:.4f} s, found {gap:.3g} s after the last", column="time_s"
            )
        self.ahead_s = ahead
        self.last = stated, now
        if gap < 0.0:  # the clock of another machine or process: it says nothing of how long it was
            return math.inf
        return gap if gap >= (PAUSE_S if stated else CLOCK_PAUSE_S) - 1e-9 else 0.0
