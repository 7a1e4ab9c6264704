"""Pulse widths for recruitments, one channel, with the play of hysteresis undone."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from fes_pin.control.limits import Limiter, StimulationLimits
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import shortened
from fes_pin.muscles.recruitment import LinearRecruitment, MeasuredRecruitment, follows, through_play

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
        if not isinstance(curve, LinearRecruitment | MeasuredRecruitment):
            raise InputError(f"expected a recruitment curve, found {shortened(curve)}", column="curve")
        self.curve, self.half = curve, float(half_width_us)
        self.threshold, self.saturation = float(curve.threshold_us), float(curve.saturation_us)
        if not (self.half == 0.0 or 0.0 < self.half < self.threshold):
            raise InputError(f"expected a half width from 0 to below the threshold of {self.threshold:g} us")
        self.limiter = Limiter(StimulationLimits.given(limits), self.threshold, self.saturation)
        self.followed = 0.0
        # one straight line needs no arrays
        self._straight = type(curve) is LinearRecruitment

    @property
    def most(self) -> float:
        """The recruitment that can be held for long."""
        return self._recruited(self.limiter.steady_us)

    def reset(self) -> None:
        """After a rest: the nerve follows from 0. What was given in the last second stays given."""
        self.followed = self.limiter.last_us = 0.0

    def __call__(self, recruitment: float) -> tuple[float, float]:
        """The pulse width in us for a recruitment, and the recruitment that it makes.

        A recruitment that is not a number counts as 0.
        """
        if not math.isfinite(recruitment) or recruitment <= (-SWITCH if self.limiter.last_us else 0.0):
            return self.give(0.0)
        if not self.limiter.last_us and recruitment < SWITCH:
            return self.give(0.0)
        return self.give(self._through_play(min(max(recruitment, 0.0), 1.0)))

    def give(self, width_us: float, at_once: bool = False) -> tuple[float, float]:
        """The pulse width nearest to one that the limits allow, and the recruitment that it makes; see `Limiter`."""
        width = self.limiter.allowed(min(width_us, self.saturation), at_once)
        made = self._made(width)
        self.followed = follows(self.followed, width, self.half)
        self.limiter.give(width)
        return width, made

    def _through_play(self, wanted: float) -> float:
        width = through_play(self.followed, self._width(wanted), self.half)
        if width >= self.threshold:
            return width
        off, least = self._made(0.0), self._made(self.threshold)
        return 0.0 if abs(off - wanted) < abs(least - wanted) else self.threshold

    def _made(self, width: float) -> float:
        return self._recruited(follows(self.followed, width, self.half))

    def _width(self, recruitment: float) -> float:
        if not self._straight:
            return float(self.curve.pulse_width_us(recruitment))
        width = self.threshold + recruitment * (self.saturation - self.threshold)
        return 0.0 if recruitment <= 0.0 else min(width, self.saturation)

    def _recruited(self, width: float) -> float:
        if not self._straight:
            return float(self.curve.recruitment(width))
        return min(max((width - self.threshold) / (self.saturation - self.threshold), 0.0), 1.0)
