"""Recruitment curves, pulse width to the fraction of fibres that answer, and their exact inverses.

Every curve is 0 up to its threshold, 1 from its saturation on, and rises strictly between; curves differ in the shape
between. The inverse gives pulse width 0 for recruitment 0, else one between threshold and saturation.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import between, numbers
from fes_pin.data.read_only import ReadOnly

LONGEST_US = 5000.0
"""Pulse width, us, beyond which no stimulator of nerves goes and recruitment of a nerve has long been complete: nerve
fibres have chronaxies of 0.05 to 0.7 ms (Ranck 1975, Brain Res. 98:417-440); surface stimulators give up to 500 us
(Valtin and others, Eur. J. Transl. Myol. 26:6076, 2016), section II of Dombre, Fournier and Coiffet uses 1000 us."""
LEAST_US = 10.0
"""Pulse width, us, below which no nerve is recruited whole: a curve that ends there is in ms or s."""
RANGES = {
    "threshold_us": (0.0, LONGEST_US),
    "saturation_us": (LEAST_US, LONGEST_US),
    "curvature": (-20.0, 20.0),
    "steepness": (0.01, 30.0),
    "middle": (0.0, 1.0),
    "delay": (0.05, 20.0),
    "growth": (0.05, 20.0),
    "log_exponent": (-1.2, 2.0),
    "log_bend": (-3.0, 5.0),
}
"""What parameters of curves can be: widths of a stimulator; a place on the way; shapes from a straight line to a step,
as far as double precision inverts them. Hill's are those of the cause `recruitment_curvature`."""
LEAST_CURVATURE = 1e-3
"""A saturating curve with less curvature is straight to 0.01 % of recruitment."""
STRAIGHT_BELOW = 1e-6
"""Fraction of the way below which a Hill curve is straight, as in the model of the same name."""


@dataclass(frozen=True, eq=False)
class LinearRecruitment(ReadOnly):
    """Straight from threshold to saturation; the defaults are the paper's (section II: 180 us, 1 ms).

    Parameters
    ----------
    threshold_us, saturation_us
        Pulse widths, us: numbers, or arrays with one per channel.

    Raises
    ------
    InputError
        A parameter that is not a number within `RANGES`, or saturation not above threshold.
    """

    threshold_us: Any = 180.0
    saturation_us: Any = 1000.0

    def __post_init__(self) -> None:
        for item in fields(self):
            name = f"{item.name} of a recruitment curve"
            value = numbers(getattr(self, item.name), name)
            low, high = RANGES.get(item.name, (-np.inf, np.inf))
            wrong = value[~(np.isfinite(value) & (value >= low) & (value <= high))]
            if wrong.size:
                raise InputError(f"must lie between {low:g} and {high:g}, got {wrong.flat[0]:g}", column=name)
            object.__setattr__(self, item.name, value)
        self._freeze()
        if len({getattr(self, item.name).shape for item in fields(self)} - {()}) > 1:
            raise InputError("arrays of a recruitment curve must have one number per channel each")
        if (self.saturation_us <= self.threshold_us).any():
            raise InputError("a recruitment curve needs threshold_us < saturation_us")

    def shape(self, x: Any) -> Any:
        """The curve at the fraction x of the way from threshold to saturation, not yet scaled to be 0 and 1 there."""
        return x

    def inverse_shape(self, y: Any) -> Any:
        """Fraction of the way at which the curve is y."""
        return y

    def recruitment(self, pulse_width_us) -> np.ndarray:
        """Recruitment, 0 to 1, at pulse widths in us."""
        x = (np.asarray(pulse_width_us, dtype=float) - self.threshold_us) / (self.saturation_us - self.threshold_us)
        x, low, high = np.minimum(np.maximum(x, 0.0), 1.0), self.shape(0.0), self.shape(1.0)
        return np.where(x <= 0.0, 0.0, np.where(x >= 1.0, 1.0, (self.shape(x) - low) / (high - low)))

    def pulse_width_us(self, recruitment) -> np.ndarray:
        """Pulse width in us for a recruitment: 0 for 0 and below, saturation for 1 and above."""
        r, low, high = np.minimum(np.maximum(recruitment, 0.0), 1.0), self.shape(0.0), self.shape(1.0)
        way = self.inverse_shape(low + r * (high - low))
        width = self.threshold_us + way * (self.saturation_us - self.threshold_us)
        width = np.where(r < 1.0, np.maximum(width, self.threshold_us), self.saturation_us)
        return (r > 0.0) * np.minimum(width, self.saturation_us)


@dataclass(frozen=True, eq=False)
class SaturatingRecruitment(LinearRecruitment):
    """Steep first: `(1 - exp(-k x)) / (1 - exp(-k))` (Ding 2007, Muscle Nerve 36:214-222)."""

    curvature: Any = 3.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if (np.abs(self.curvature) < LEAST_CURVATURE).any():
            raise InputError(f"a curvature below {LEAST_CURVATURE:g} is a straight line: use LinearRecruitment")

    def shape(self, x):
        """See the class."""
        return np.expm1(-self.curvature * x)

    def inverse_shape(self, y):
        """See the class."""
        return -np.log1p(y) / self.curvature


@dataclass(frozen=True, eq=False)
class SigmoidRecruitment(LinearRecruitment):
    """Logistic about `middle` (a fraction of the way), scaled to be 0 at threshold and 1 at saturation."""

    steepness: Any = 10.0
    middle: Any = 0.5

    def shape(self, x):
        """See the class."""
        return 1.0 / (1.0 + np.exp(-self.steepness * (x - self.middle)))

    def inverse_shape(self, y):
        """See the class."""
        return self.middle + np.log(y / (1.0 - y)) / self.steepness


@dataclass(frozen=True, eq=False)
class GompertzRecruitment(LinearRecruitment):
    """Gompertz: slow start, slower end, `exp(-b exp(-k x))` scaled to be 0 at threshold and 1 at saturation."""

    delay: Any = 5.0
    growth: Any = 6.0

    def shape(self, x):
        """See the class."""
        return np.exp(-self.delay * np.exp(-self.growth * x))

    def inverse_shape(self, y):
        """See the class."""
        return -np.log(-np.log(y) / self.delay) / self.growth


@dataclass(frozen=True, eq=False)
class HillRecruitment(LinearRecruitment):
    """Hill's function, 1 at saturation: `(1 + e) x^n / (1 + e x^n)`, n = exp(log_exponent), e = exp(log_bend) - 1.

    The same curve, with the same parameters, as the cause `recruitment_curvature`, to the straight line that it has
    below a millionth of the way.
    """

    log_exponent: Any = 0.1
    log_bend: Any = 0.2

    def shape(self, x):
        """See the class."""
        n, bend = np.exp(self.log_exponent), np.exp(self.log_bend)
        power = x * np.maximum(x, STRAIGHT_BELOW) ** (n - 1.0)
        return bend * power / (1.0 + (bend - 1.0) * power)

    def inverse_shape(self, y):
        """See the class."""
        n, bend = np.exp(self.log_exponent), np.exp(self.log_bend)
        power = y / (bend - (bend - 1.0) * y)
        straight = power * STRAIGHT_BELOW ** (1.0 - n)
        return np.where(straight < STRAIGHT_BELOW, straight, power ** (1.0 / n))


class Hysteresis:
    """Play between stimulator and nerve: the width that acts follows the pulse width only beyond `half_width_us`.

        acting' = clip(acting, w - half_width_us, w + half_width_us)

    The same as the cause `recruitment_hysteresis`. Its inverse overshoots by the half width on the way up and
    undershoots on the way down; what that would need beyond threshold and saturation cannot be had and is cut there.

    Parameters
    ----------
    curve
        Recruitment of the acting width.
    half_width_us
        Half the play, 0 to `LONGEST_US`.
    acting_us
        The width that acts at the beginning, likewise.

    Raises
    ------
    InputError
        No curve, or no such widths.
    """

    def __init__(
        self, curve: "LinearRecruitment | MeasuredRecruitment", half_width_us: float, acting_us: float = 0.0
    ) -> None:
        if not isinstance(curve, LinearRecruitment | MeasuredRecruitment) or np.ndim(curve.threshold_us):
            raise InputError(f"expected a recruitment curve of one channel, got {curve!r:.40}", column="curve")
        self.curve, self.half_width_us = curve, between(half_width_us, 0.0, LONGEST_US, "half_width_us")
        self.acting_us = between(acting_us, 0.0, LONGEST_US, "acting_us")

    def _follows(self, pulse_width_us: float) -> float:
        """The width that acts after a pulse, us: the last one, held within half the play of the pulse's."""
        half = self.half_width_us
        return min(max(self.acting_us, pulse_width_us - half), pulse_width_us + half)

    def would_recruit(self, pulse_width_us: float) -> float:
        """Recruitment that the next pulse would have."""
        return float(self.curve.recruitment(self._follows(pulse_width_us)))

    def recruitment(self, pulse_width_us: float) -> float:
        """Recruitment by the next pulse, which moves the play."""
        self.acting_us = self._follows(pulse_width_us)
        return float(self.curve.recruitment(self.acting_us))

    def reach(self) -> tuple[float, float]:
        """Least and greatest recruitment that the next pulse can have, other than by no pulse."""
        threshold, saturation = float(self.curve.threshold_us), float(self.curve.saturation_us)
        low = min(self.acting_us, threshold + self.half_width_us)
        high = max(self.acting_us, saturation - self.half_width_us)
        return float(self.curve.recruitment(low)), float(self.curve.recruitment(high))

    def pulse_width_us(self, recruitment: float) -> float:
        """Pulse width for a recruitment from the present state: exact within `reach`, else the nearest; 0 for 0."""
        if recruitment <= 0.0:
            return 0.0
        target, acting, half = float(self.curve.pulse_width_us(recruitment)), self.acting_us, self.half_width_us
        aim = target + (half if target > acting else -half if target < acting else 0.0)
        return min(max(aim, float(self.curve.threshold_us)), float(self.curve.saturation_us))


@dataclass(frozen=True, eq=False)
class MeasuredRecruitment(ReadOnly):
    """Straight lines between measured points (pulse width, recruitment).

    Parameters
    ----------
    pulse_widths_us, recruitments
        At least two points, us, the last one from `LEAST_US` to `LONGEST_US`.
        Both must rise strictly; recruitments from 0 to 1.

    Raises
    ------
    InputError
        The points are not of that kind.
    """

    pulse_widths_us: Any
    recruitments: Any

    def __post_init__(self) -> None:
        widths = numbers(self.pulse_widths_us, "pulse widths of a recruitment curve")
        values = numbers(self.recruitments, "recruitments of a recruitment curve")
        good = widths.shape == values.shape and widths.ndim == 1 and len(values) >= 2
        if not good or not (np.diff(widths) > 0).all() or not (np.diff(values) > 0).all():
            raise InputError("a measured recruitment curve needs two or more points that rise in both columns")
        if values[0] != 0.0 or values[-1] != 1.0 or widths[0] < 0.0:
            ends = "begin at recruitment 0 and end at 1, with widths from 0"
            raise InputError(f"a measured recruitment curve must {ends}")
        if not LEAST_US <= widths[-1] <= LONGEST_US:
            ends = f"{LEAST_US:g} to {LONGEST_US:g} us"
            raise InputError(f"pulse widths of a recruitment curve end at {ends}, got {widths[-1]:g}")
        vars(self).update(pulse_widths_us=widths, recruitments=values)
        self._freeze()

    @property
    def threshold_us(self) -> float:
        """The first width, us."""
        return float(self.pulse_widths_us[0])

    @property
    def saturation_us(self) -> float:
        """The last width, us."""
        return float(self.pulse_widths_us[-1])

    def recruitment(self, pulse_width_us) -> np.ndarray:
        """Recruitment, 0 to 1, at pulse widths in us."""
        return np.interp(pulse_width_us, self.pulse_widths_us, self.recruitments)

    def pulse_width_us(self, recruitment) -> np.ndarray:
        """Pulse width in us for a recruitment: 0 for 0 and below, saturation for 1 and above."""
        width = np.interp(recruitment, self.recruitments, self.pulse_widths_us)
        return np.where(np.asarray(recruitment) > 0.0, width, 0.0)


class ChannelRecruitment:
    """One curve for all channels, or one for each.

    Parameters
    ----------
    curves
        One for all channels, or a sequence with one per channel.
    n
        Number of channels.

    Raises
    ------
    InputError
        The number of curves, or of one curve's parameters, is not n, or something is no curve.
    """

    def __init__(self, curves, n: int) -> None:
        self.each = isinstance(curves, Sequence)
        self.curves, self.n = list(curves) if self.each else [curves], n
        if self.each and len(self.curves) != n:
            raise InputError(f"expected one recruitment curve or {n}, got {len(self.curves)}")
        for curve in self.curves:
            if not isinstance(curve, (LinearRecruitment, MeasuredRecruitment)):
                raise InputError(f"expected a recruitment curve, got {curve!r:.40}")
            for item in fields(curve) if isinstance(curve, LinearRecruitment) else ():
                shape = np.shape(getattr(curve, item.name))
                if shape != () and (self.each or shape != (n,)):
                    raise InputError(f"{item.name} of a recruitment curve must be 1 number or {n}, got shape {shape}")

    def __eq__(self, other) -> bool:
        return isinstance(other, ChannelRecruitment) and (self.n, self.curves) == (other.n, other.curves)

    def __hash__(self) -> int:
        return hash((self.n, *self.curves))

    def pulse_width_us(self, recruitment: np.ndarray) -> np.ndarray:
        """Pulse widths in us (..., n) for recruitments (..., n)."""
        r = np.asarray(recruitment, dtype=float)
        if not self.each:
            return self.curves[0].pulse_width_us(r)
        return np.stack([curve.pulse_width_us(r[..., i]) for i, curve in enumerate(self.curves)], axis=-1)
