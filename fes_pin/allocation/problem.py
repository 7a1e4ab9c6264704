"""The problem of an allocation: channels and their moment arms, weights of torque and effort, limits."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from fes_pin.allocation.inputs import fractions, torque_matrix
from fes_pin.data.errors import InputError
from fes_pin.data.named import NamedArray
from fes_pin.data.numbers import all_known, between, by_name, known_word, positive_number, truth
from fes_pin.data.read_only import ReadOnly
from fes_pin.muscles.recruitment import ChannelRecruitment, LinearRecruitment

EFFORT = 1e-4
"""Default price of effort: recruiting the strongest channel fully costs as much as missing 1 % of its torque."""
LEAST_PRICE, LARGEST_PRICE = 1e-10, 1e8
"""Prices of effort lie between: below, double precision cannot separate choices; above, nothing is ever recruited."""
LEAST_WEIGHT, LARGEST_WEIGHT = 1e-6, 1e6
"""Weights of joints that count lie between, for the same reason."""
LEAST_LEFT = 0.05
"""A channel with less strength left than this costs as if it had this much."""
SECONDS = 1.0
"""Default limit on the search for the best channels to switch off, s: thirty channels take a few hundredths."""
EPSILON = float(np.finfo(float).eps)
Limits = tuple[np.ndarray, np.ndarray]
"""Least and greatest recruitment of each channel."""


@dataclass(frozen=True, eq=False)
class Options:
    """Options of an `Allocator`; those that do not depend on the channels are checked here.

    Parameters
    ----------
    recruitment
        Curve for all channels or one per channel; the paper's threshold and saturation by default.
    weights
        Per joint, how much its torque matters: 0, or 1e-6 to 1e6, by name or (joints,).
    effort
        Price of recruitment squared, of `Problem.scale`, the squared torque of the strongest channel: 1e-10 to 1e8; a
        number or one each.
    effort_kind
        `squares`; `cubes` (of recruitment, which spreads it over more channels); `fatigue` (squares, dearer the less
        strength a fatigued channel has: by one over its square).
    lexicographic
        First the least torque error, whatever it costs; among all choices that reach it, the least effort and change.
    change
        Price of changing a recruitment, likewise.
    lower, upper
        Limits of recruitment within 0 and 1, by name or (n,); upper 0 is a channel that is not to be used.
    least
        Least recruitment at which a channel is reliable: r is 0 or at least this; None: any.
    rounding, seconds
        With `least`: only round the answer without it, cheaply; else stop the search after this time. The allocation's
        `gap` says how much better another choice could be.
    rate
        Greatest change of a recruitment from one call to the next, up to 1, or infinite.
    dead
        Names of channels that do not answer.
    """

    recruitment: Any = None
    weights: Any = 1.0
    effort: Any = EFFORT
    effort_kind: str = "squares"
    lexicographic: bool = False
    change: float = 0.0
    lower: Any = 0.0
    upper: Any = 1.0
    least: Any = None
    rounding: bool = False
    seconds: float = SECONDS
    rate: float = float("inf")
    dead: Any = ()

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> "Options":
        """Options by name.

        Raises
        ------
        InputError
            Unknown name, or a value out of range.
        """
        all_known(given, [item.name for item in fields(cls)], "option")
        return cls(**given)

    def __post_init__(self) -> None:
        vars(self).update({n: truth(getattr(self, n), n) for n in ("lexicographic", "rounding")})
        known_word(self.effort_kind, ("squares", "cubes", "fatigue"), "effort_kind")
        if self.effort_kind == "cubes" and self.lexicographic:
            raise InputError("lexicographic goes with effort squares or fatigue, not with cubes")
        if self.least is not None and (self.effort_kind == "cubes" or self.lexicographic):
            raise InputError("least recruitments go with effort squares or fatigue, not with cubes or lexicographic")
        rate = positive_number(self.rate, "rate", infinite=True)
        if rate < np.inf:
            between(rate, 0.0, 1.0, "rate (of recruitment, not of pulse width)")
        seconds = positive_number(self.seconds, "seconds", infinite=True)
        vars(self).update(rate=rate, seconds=seconds, change=between(self.change, 0.0, LARGEST_PRICE, "change"))


@dataclass(frozen=True, eq=False)
class AllocationProblem(ReadOnly):
    """The program of an allocation with its numbers checked; nothing in it changes.

        min over r of sum w (R r - torque)^2 / 2 + effort + change / 2 |r - previous|^2,  lower <= r <= upper

    divided by `scale`.

    Attributes
    ----------
    names, joints
        Channels and joints.
    nominal, matrix
        (joints, n) torque at full recruitment, N m, and the same without the channels that are not used.
    curves
        Recruitment curves.
    weights, prices
        (joints,), and of effort (n,).
    lower, upper, least
        (n,) limits, least reliable recruitment or None.
    change, rate
        Price, and greatest change per call.
    cubes, lexicographic, rounding, seconds
        See `Options`.
    scale
        (N m)^2, the weighed squared torque of the strongest channel.
    assumed, held, band
        Strength and posture, and joints whose moment arms were taken at another angle than asked, both in words, and
        the factors between which the strength is likely to lie (`Nerves`); without nerves nothing, and 1.
    other
        Order of the posture's joints, if it came by name in another one than `joints`: torques then need names.
    """

    names: tuple[str, ...]
    joints: tuple[str, ...]
    nominal: np.ndarray
    matrix: np.ndarray
    curves: ChannelRecruitment
    weights: np.ndarray
    prices: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    least: np.ndarray | None
    change: float
    rate: float
    cubes: bool
    lexicographic: bool
    rounding: bool
    seconds: float
    scale: float
    assumed: str
    held: tuple[str, ...]
    band: tuple[float, float]
    other: tuple[str, ...] | None

    @property
    def n(self) -> int:
        """Number of channels."""
        return len(self.names)

    @property
    def squares(self) -> np.ndarray:
        """Curvature of the torque error over recruitment, (n, n), of `scale`."""
        return (self.matrix.T * self.weights) @ self.matrix / self.scale

    @property
    def pull(self) -> np.ndarray:
        """Derivative of the slope over recruitment by a wanted torque, (joints, n): `torque @ pull`."""
        return -self.weights[:, None] * self.matrix / self.scale

    @property
    def plain(self) -> bool:
        """Whether the program is one of squares within limits, so that torques may be allocated many at a time."""
        return self.least is None and not self.cubes and not self.lexicographic

    def limits(self, before: np.ndarray) -> Limits:
        """Limits of recruitment under the rate limit, from the recruitments in force."""
        if self.rate == np.inf:
            return self.lower, self.upper
        lower, upper = within_rate(before, self.rate, self.lower, self.upper)
        if self.least is not None:  # between off and its least recruitment a channel may jump
            lower = np.where(lower < self.least, self.lower, lower)
            upper = np.maximum(upper, np.minimum(self.least, self.upper))
        return lower, upper


class OfProblem:
    """Base of what holds a `problem`: its channels and joints."""

    problem: AllocationProblem

    @property
    def names(self) -> tuple[str, ...]:
        """Channels."""
        return self.problem.names

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints."""
        return self.problem.joints


def within_rate(before: np.ndarray, rate: float, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Limits of the next recruitments; what the rate leaves within rounding of a limit is at the limit."""
    least, most = np.clip(before - rate, lower, upper), np.clip(before + rate, lower, upper)
    dust = 4.0 * EPSILON
    return np.where(least - lower <= dust, lower, least), np.where(upper - most <= dust, upper, most)


def problem_of(nerves: Any, q: Any, v: Any, options: Options) -> AllocationProblem:
    """The problem of nerves at a posture and its rates (or of a torque matrix) with options.

    Raises
    ------
    InputError
        Anything that `Options` or the matrix must not be.
    """
    nominal, names, joints = torque_matrix(nerves, q, v)
    named = hasattr(nerves, "torque_matrix")
    n = len(names)
    curve = LinearRecruitment() if options.recruitment is None else options.recruitment
    lower, upper, least = recruitment_limits(options, names)
    weights = checked_weights(options.weights, joints)
    prices = checked_prices(options.effort, names)
    if options.effort_kind == "fatigue":
        prices = prices / np.maximum(getattr(nerves, "left_over", np.ones(n)), LEAST_LEFT) ** 2
    matrix = np.where(upper == 0.0, 0.0, nominal)
    scale = float(np.einsum("ji,j,ji->i", matrix, weights, matrix).max()) or 1.0
    return AllocationProblem(
        *(names, joints, nominal, matrix, ChannelRecruitment(curve, n), weights, prices, lower, upper, least),
        **{name: getattr(options, name) for name in ("change", "rate", "lexicographic", "rounding", "seconds")},
        cubes=options.effort_kind == "cubes",
        scale=scale,
        assumed=nerves.assumed(q) if named else "",
        held=tuple(nerves.held(q)) if named else (),
        band=nerves.strength_band if named else (1.0, 1.0),
        other=q.names if isinstance(q, NamedArray) and named and q.names != joints else None,
    )


def checked_weights(weights: Any, joints: tuple[str, ...]) -> np.ndarray:
    """Weights of the joints, (joints,).

    Raises
    ------
    InputError
        Neither 0 nor 1e-6 to 1e6.
    """
    array = by_name(weights, joints, "weights", 1.0)
    wrong = (array != 0.0) & ((array < LEAST_WEIGHT) | (array > LARGEST_WEIGHT))
    if wrong.any():
        j = int(np.argmax(wrong))
        must = f"must be 0 or {LEAST_WEIGHT:g} to {LARGEST_WEIGHT:g}"
        raise InputError(f"weight of {joints[j]} {must}, got {array[j]:g}")
    return array


def checked_prices(effort: Any, names: tuple[str, ...]) -> np.ndarray:
    """Prices of effort, (n,).

    Raises
    ------
    InputError
        Not 1e-10 to 1e6.
    """
    array = by_name(effort, names, "effort", EFFORT)
    if (array < LEAST_PRICE).any():
        raise InputError(f"effort must cost {LEAST_PRICE:g} or more; for torque before any effort ask lexicographic")
    if (array > LARGEST_PRICE).any():
        raise InputError(f"effort must cost {LARGEST_PRICE:g} or less, got {array.max():g}")
    return array


def recruitment_limits(options: Options, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Lower and upper limits and least recruitments, (n,), with dead channels at 0.

    Raises
    ------
    InputError
        Limits that are not 0 <= lower <= upper <= 1, a least recruitment outside or above the upper limit of a channel
        whose lower limit is not 0, an unknown dead channel.
    """
    lower = fractions(options.lower, names, "lower limits")
    upper = fractions(options.upper, names, "upper limits", 1.0)
    dead = options.dead
    if not isinstance(dead, Iterable):
        raise InputError(f"dead must be names of channels, got {dead!r:.40}")
    for name in (dead,) if isinstance(dead, str) else dead:
        all_known([name], names, "channel")
        lower[names.index(name)] = upper[names.index(name)] = 0.0
    wrong = lower > upper
    if wrong.any():
        i = int(np.argmax(wrong))
        raise InputError(f"limits of {names[i]} must be 0 <= lower <= upper <= 1, got {lower[i]} and {upper[i]}")
    if options.least is None:
        return lower, upper, None
    least = fractions(options.least, names, "least recruitment")
    never = (lower > 0.0) & (least > upper)
    if never.any():
        i = int(np.argmax(never))
        off = f"may not be off, for its lower limit is {lower[i]:g}"
        on = f"not on, for its upper limit {upper[i]:g} lies below its least recruitment {least[i]:g}"
        raise InputError(f"{names[i]} {off}, and {on}")
    return lower, upper, least
