"""Pulse widths for recruitments, one channel, with the play of hysteresis undone."""

from __future__ import annotations

import math
from typing import Any, Protocol

from fes_pin.data.errors import InputError
from fes_pin.muscles.recruitment import LinearRecruitment


class Curve(Protocol):
    """A recruitment curve; `fes_pin.muscles.recruitment` has several."""

    @property
    def threshold_us(self) -> Any:
        """Pulse width that recruits the first fibre."""

    @property
    def saturation_us(self) -> Any:
        """Pulse width that recruits the last."""

    def recruitment(self, pulse_width_us: Any) -> Any:
        """Recruitment at a pulse width."""

    def pulse_width_us(self, recruitment: Any) -> Any:
        """Pulse width for a recruitment."""


class PulseWidth:
    """Chooses the pulse width that recruits a wanted share of the muscle.

    Only 0 and threshold to saturation are ever given. The nerve follows a pulse width with play of half width h
    (`recruitment_hysteresis`): on the way up the width is h more, on the way down h less than the curve says. Where the
    play asks for a width that is not allowed, the allowed one is taken whose recruitment comes closest.

    Parameters
    ----------
    curve
        Recruitment without hysteresis.
    half_width_us
        h; below the threshold.

    Raises
    ------
    InputError
        If h is negative, none, or not below the threshold: then nothing would end a contraction.
    """

    def __init__(self, curve: Curve, half_width_us: float = 0.0) -> None:
        self.curve, self.half = curve, float(half_width_us)
        self.threshold, self.saturation = float(curve.threshold_us), float(curve.saturation_us)
        if not (self.half == 0.0 or 0.0 < self.half < self.threshold):
            raise InputError(f"expected a half width from 0 to below the threshold of {self.threshold:g} us")
        self.followed = 0.0
        # one straight line needs no arrays
        self._straight = type(curve) is LinearRecruitment

    def __call__(self, recruitment: float) -> tuple[float, float]:
        """The pulse width in us for a recruitment, and the recruitment that it makes.

        A recruitment that is not a number counts as 0.
        """
        wanted = min(max(recruitment, 0.0), 1.0) if math.isfinite(recruitment) else 0.0
        target = self._width(wanted)
        if self.half == 0.0:
            width = self._allowed(target)
            # the curve's own inverse: exact but for what the limits took
            return width, wanted if width == target else self._recruited(width)
        if wanted == 0.0:
            width = 0.0
        else:
            ahead = self.half if target > self.followed else -self.half if target < self.followed else 0.0
            width = target + ahead
            if width < self.threshold:
                off, least = self._made(0.0), self._made(self.threshold)
                width = 0.0 if abs(off - wanted) < abs(least - wanted) else self.threshold
        width = self._allowed(width)
        made = self._made(width)
        self.followed = self._follows(width)
        return width, made

    def _allowed(self, width: float) -> float:
        return 0.0 if not width >= self.threshold else min(width, self.saturation)

    def _follows(self, width: float) -> float:
        return min(max(self.followed, width - self.half), width + self.half)

    def _made(self, width: float) -> float:
        return self._recruited(self._follows(width))

    def _width(self, recruitment: float) -> float:
        if not self._straight:
            return float(self.curve.pulse_width_us(recruitment))
        width = self.threshold + recruitment * (self.saturation - self.threshold)
        return 0.0 if recruitment <= 0.0 else min(width, self.saturation)

    def _recruited(self, width: float) -> float:
        if not self._straight:
            return float(self.curve.recruitment(width))
        return min(max((width - self.threshold) / (self.saturation - self.threshold), 0.0), 1.0)
