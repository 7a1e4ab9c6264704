"""Pulse widths for recruitments, one channel, with the play of hysteresis undone."""

import math
from collections.abc import Mapping
from typing import Any

from fes_pin.control.limits import Limiter, StimulationLimits
from fes_pin.data.errors import InputError
from fes_pin.muscles.recruitment import Hysteresis, LinearRecruitment, MeasuredRecruitment

SWITCH = 0.1
"""Pulses begin where this recruitment is wanted, and end where as much less than none is. Near rest the feedback wants
0.03 to either side, which is the sensor's noise seen through the observer: answered pulse by pulse it is felt, 10 to 20
times a second, and moves nothing. With 0.1 pulses begin or end about once a second there, and the joint is held to 0.5
degrees within half a degree of rest, as before everywhere else (`analysis/ankle_control.py`)."""


class PulseWidth:
    """Chooses the pulse width that recruits a wanted share of the muscle.

    Only 0 and threshold to saturation are ever given, within the caller's limits. Pulses are switched on and off
    with hysteresis (`SWITCH`); between, what is wanted below the threshold gets pulses at it. The nerve follows a
    pulse width with play of half width h (`recruitment_hysteresis`): on the way up the width is h more, on the way
    down h less than the curve says. Where the play asks for a width that is not allowed, the allowed one is taken
    whose recruitment comes closest.

    Parameters
    ----------
    curve
        Recruitment without hysteresis.
    half_width_us
        h; below the threshold.
    limits
        Of the caller; by default none.

    Raises
    ------
    InputError
        If h is negative, none, or not below the threshold: then nothing would end a contraction. If the limits allow no
        pulses.
    """

    def __init__(
        self,
        curve: LinearRecruitment | MeasuredRecruitment,
        half_width_us: float = 0.0,
        limits: StimulationLimits | Mapping[str, Any] | None = None,
    ) -> None:
        self.play = Hysteresis(curve, half_width_us)
        self.threshold, self.saturation = float(curve.threshold_us), float(curve.saturation_us)
        if self.play.half_width_us and self.play.half_width_us >= self.threshold:
            raise InputError(f"expected a half width from 0 to below the threshold of {self.threshold:g} us")
        self.limiter = Limiter(StimulationLimits.given(limits), self.threshold, self.saturation)

    @property
    def most(self) -> float:
        """The recruitment that can be held for long."""
        return float(self.play.curve.recruitment(self.limiter.steady_us))

    def reset(self) -> None:
        """After a rest: the nerve follows from 0. What was given in the last second stays given."""
        self.play.acting_us = self.limiter.last_us = 0.0

    def __call__(self, recruitment: float) -> tuple[float, float]:
        """The pulse width in us for a recruitment, and the recruitment that it makes.

        A recruitment that is not a number counts as 0.
        """
        if not math.isfinite(recruitment) or recruitment <= (-SWITCH if self.limiter.last_us else 0.0):
            return self.give(0.0)
        if not self.limiter.last_us and recruitment < SWITCH:
            return self.give(0.0)
        return self.give(self._nearest(min(max(recruitment, 0.0), 1.0)))

    def give(self, width_us: float, at_once: bool = False) -> tuple[float, float]:
        """The pulse width nearest to one that the limits allow, and the recruitment that it makes; see `Limiter`."""
        width = self.limiter.allowed(min(width_us, self.saturation), at_once)
        self.limiter.give(width)
        return width, self.play.recruitment(width)

    def _nearest(self, wanted: float) -> float:
        """The pulse width, 0 or from the threshold on, whose recruitment through the play comes closest."""
        width = self.play.pulse_width_us(wanted)
        if width > self.threshold:
            return width
        off, least = self.play.would_recruit(0.0), self.play.would_recruit(self.threshold)
        return 0.0 if abs(off - wanted) < abs(least - wanted) else self.threshold
