"""Whether a controller is called once a pulse.

A call is a pulse unless it comes too early: with it, more pulses than those of `PAUSE_S` would be ahead of a beat of
`BEAT_S`, or it is as near to the pulse before as `NEAR_S`. Calls that are up to 0.13 s late, and those that catch up
with them, are pulses; no second holds more than 53. A call that is none gives no pulse, and such calls for long are an
error. Limits of charge and rate count the time between pulses, not calls: see `Limiter.wait`.
"""

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
BEAT_S = 0.95 * PULSE_S
"""Pulses may come so often for good, every 21.1 ms: a timer of 22 ms in place of 22.2 does."""
NEAR_S = 0.25 * PULSE_S
"""No two pulses are so near, 5.6 ms: calls of a program that was held up come within one."""
TOO_FAST_S, LEAST_S = 8.0 * PULSE_S, 0.1 * PULSE_S
"""Time that passes in calls that are no pulses, since one was in time, from which on each of them is an error; a call
counts the least at least. At 100 Hz it is there after 0.4 s, at 50 Hz after 4 s; 80 calls at once stay below it."""


class PulseClock:
    """Times of the calls of a controller, as they are stated or by the computer's clock.

    Parameters
    ----------
    is_limited
        Whether limits depend on the time between pulses: calls without a stated time are then counted, too. Without
        such limits they may be a simulation that runs as fast as it can.
    """

    def __init__(self, is_limited: bool) -> None:
        self.is_limited, self.last = is_limited, (math.nan, math.nan)
        self._begin()

    def _begin(self) -> None:
        """Calls that were kept back over a pause are not all pulses: three at once are."""
        self.ahead_s, self.since_s, self.early_s = 0.5 * PAUSE_S, 0.0, 0.0

    def take(self, time_s: float | None) -> tuple[float, float] | None:
        """Note a call.

        Returns
        -------
        tuple, or None
            Time in s since the last pulse, 0 where it is not known and `PULSE_S` where it is not counted; and, if it
            was a pause, how long that was, s, else 0. None of a call that comes too early to be a pulse.

        Raises
        ------
        InputError
            For a stated time that is none, or calls that have come too fast for long; the call does not count.
        """
        now = math.nan if time_s is None else number(time_s, "time_s"), time.monotonic()
        stated, by_clock = (one - before for one, before in zip(now, self.last, strict=True))
        self.last = now
        if math.isnan(by_clock):
            return 0.0, 0.0
        is_stated = not math.isnan(stated)
        gap, longest = (stated, PAUSE_S) if is_stated else (by_clock, CLOCK_PAUSE_S)
        if not 0.0 <= gap < longest - 1e-9:
            self._begin()
            return 0.0, gap if gap > 0.0 else math.inf  # another clock says nothing of how long it was
        self.since_s += gap
        self.ahead_s = max(self.ahead_s - gap, 0.0)
        self.early_s *= self.ahead_s > 0.0
        is_counted = is_stated or self.is_limited
        if not is_counted or (self.since_s > NEAR_S and self.ahead_s + BEAT_S <= PAUSE_S):
            since_s, self.since_s = self.since_s, 0.0
            self.ahead_s = min(self.ahead_s + BEAT_S, PAUSE_S)
            return since_s if is_counted else PULSE_S, 0.0
        self.early_s += max(gap, LEAST_S)
        if self.early_s > TOO_FAST_S:
            found = f"found many that came faster, this one after {gap:.3g} s; simulations state their time"
            raise InputError(f"expected one call per pulse, every {PULSE_S:.4f} s, {found}", column="time_s")
        return None
