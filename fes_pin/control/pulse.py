"""Pulse widths for recruitments, one channel, with the play of hysteresis undone, within the limits of a caller.

Limits are those of the pulse width and its rate, of charge, and of the angles of the joint.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from fes_pin.control.dynamics import ANGLES_RAD, PULSE_S
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import as_number, between, shortened
from fes_pin.data.pulses import RANGES, in_range
from fes_pin.muscles.recruitment import Hysteresis, LinearRecruitment, MeasuredRecruitment

BURST = 0.2
"""Share of a second's charge that may be given at once; the remaining charge may be given steadily. Together they are
the most that any one second can hold."""


@dataclass(frozen=True)
class StimulationLimits:
    """Limits that hold for every pulse, whatever the feedback wants; by default the muscle's own.

    Where two limits contradict each other in one pulse, the one that gives less charge wins: a width that may fall by
    44 us only falls farther, to 0 if need be, where the charge of the last second allows no more.

    Parameters
    ----------
    pulse_width_us
        The widest pulse, us; beyond saturation it changes nothing.
    rate_us_per_s
        How fast the width may rise or fall, us/s. Pulses below threshold are never given, so that switching on at the
        threshold and off from it is free.
    charge_uc_per_s
        Charge of all pulses within any one second, uC; needs `current_ma`. What may be given steadily is 1 - `BURST`
        of it.
    current_ma
        Amplitude of the pulses, mA.
    range_of_motion_rad
        Angles that this joint may have: references outside are input errors, readings outside are faults.
    ramp_s
        Time that pulses take to ramp down after a fault, s: a loaded joint that is let go at once falls. 0 is at once.

    Raises
    ------
    InputError
        For a limit that is none, that no stimulator has (`RANGES`: probably another unit), or that contradicts another.
    """

    pulse_width_us: float = math.inf
    rate_us_per_s: float = math.inf
    charge_uc_per_s: float = math.inf
    current_ma: float | None = None
    range_of_motion_rad: tuple[float, float] = ANGLES_RAD
    ramp_s: float = 0.2

    def __post_init__(self) -> None:
        for name in RANGES:
            value = getattr(self, name)
            if value is not None if name == "current_ma" else as_number(value) != math.inf:
                in_range(value, name, name)
        if self.current_ma is None and self.charge_uc_per_s < math.inf:
            raise InputError("a limit of charge needs current_ma", column="charge_uc_per_s")
        between(self.ramp_s, 0.0, 1.0, "ramp_s")
        ends = self.range_of_motion_rad
        two = isinstance(ends, tuple) and len(ends) == 2 and None not in map(as_number, ends)
        if not (two and ANGLES_RAD[0] <= ends[0] < ends[1] <= ANGLES_RAD[1]):
            low, high = ANGLES_RAD
            raise InputError(f"range_of_motion_rad: expected two angles within {low:g} to {high:g} rad, found {ends!r}")

    @classmethod
    def given(cls, limits: "StimulationLimits | Mapping[str, Any] | None") -> "StimulationLimits":
        """Limits from limits, or from a mapping of their names; without any the muscle's own.

        Raises
        ------
        InputError
            For something else, or a name that is no limit.
        """
        if isinstance(limits, cls):
            return limits
        names = [item.name for item in fields(cls)]
        if not isinstance(limits, Mapping | None) or set(limits or {}) - set(names):
            wanted = f"expected StimulationLimits, or a mapping of {', '.join(names)}"
            raise InputError(f"{wanted}, found {shortened(limits)}", column="limits")
        return cls(**(limits or {}))


class Limiter:
    """Holds pulse after pulse within the limits.

    Charge is a bucket: a fifth of a second's charge at most, refilled steadily with the other four fifths. No second
    can then hold more than the limit, and a steady demand meets a steady width instead of bursts. Charge comes before
    the rate of change: an empty bucket lets the width fall at once.

    Without `wait` pulses are taken to come every `PULSE_S`.

    Raises
    ------
    InputError
        If the widest pulse is below threshold, or the charge is too little for pulses at threshold.
    """

    def __init__(self, limits: StimulationLimits, threshold_us: float, saturation_us: float) -> None:
        in_range(saturation_us, "pulse_width_us", "saturation_us")
        between(threshold_us, 0.0, saturation_us, "threshold_us")
        if limits.pulse_width_us < threshold_us:
            expected = f"pulse_width_us: expected at least the threshold of {threshold_us:g} us"
            raise InputError(f"{expected}, found {limits.pulse_width_us:g}")
        self.most_us = min(limits.pulse_width_us, saturation_us)
        self.threshold_us = threshold_us
        self.change_us = self.most_change_us = limits.rate_us_per_s * PULSE_S
        # charge in us of pulse width: current times width
        whole = limits.charge_uc_per_s / (1e-3 * (limits.current_ma or 1.0))
        self.bucket_us, self.refill_us = BURST * whole, (1.0 - BURST) * whole * PULSE_S
        if self.refill_us < threshold_us:
            least = limits.charge_uc_per_s * threshold_us / self.refill_us
            expected = f"charge_uc_per_s: expected at least {least:.3g} uC/s, which steady pulses at threshold need"
            raise InputError(f"{expected}, found {limits.charge_uc_per_s:g}")
        self.left_us, self.last_us = self.bucket_us, 0.0

    @property
    def steady_us(self) -> float:
        """The widest pulse that may be given for long, us."""
        return min(self.most_us, self.refill_us)

    def allowed(self, width_us: float, at_once: bool = False) -> float:
        """The width nearest to a wanted one that may be given now; 0, or threshold to the widest. Notes nothing.

        Parameters
        ----------
        at_once
            A fall may be as fast as it will: after a fault.
        """
        width = width_us if width_us >= self.threshold_us else 0.0
        if not at_once and self.last_us - self.change_us >= self.threshold_us:
            width = max(width, self.last_us - self.change_us)
        width = min(width, max(self.last_us, self.threshold_us) + self.change_us)
        width = min(width, self.most_us, self.left_us)
        return width if width >= self.threshold_us else 0.0

    def wait(self, time_s: float) -> None:
        """Let the time since the last pulse have been so long: a pulse that comes early finds less charge and change.

        Of a longer time than `PULSE_S` no more counts, and a pulse's share of the bucket stays empty: where a clock is
        set forward while two pulses are near each other, a second holds no more than its charge all the same.
        """
        missing = 1.0 - min(time_s / PULSE_S, 1.0)
        if self.bucket_us < math.inf:
            self.left_us = min(self.left_us - missing * self.refill_us, self.bucket_us - self.refill_us)
        self.change_us = self.most_change_us * (1.0 - missing if self.most_change_us < math.inf else 1.0)

    def give(self, width_us: float) -> None:
        """Note the width that was given."""
        self.last_us = width_us
        if self.bucket_us < math.inf:
            self.left_us = min(self.left_us - width_us + self.refill_us, self.bucket_us)


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
