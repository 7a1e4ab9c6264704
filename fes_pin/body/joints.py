"""The 19 joints of the walking body: names, axes, limits; the ten segments that they join.

World and neutral segment frames: x forward, y left, z up. Every joint is a revolute or three revolutes in series
through one centre, written from the pelvis outwards; positive as named (adduction towards the midline, rotation
internal, bending right, lumbar rotation left).
"""

import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.named import NamedArray
from fes_pin.data.numbers import numbers, shortened
from fes_pin.data.table import own_table

SIDES = ("left", "right")
_FORWARD, _LEFT, _UP = np.eye(3)
_AXES = {"forward": _FORWARD, "left": _LEFT, "right": -_LEFT, "up": _UP}
_TURNS = {row["joint"]: row for row in own_table(Path(__file__).with_name("joints.csv"))}
RANGE_DEG = {name: (float(row["low_deg"]), float(row["high_deg"])) for name, row in _TURNS.items()}
"""Smallest and greatest angle, degrees, of a joint of either side."""

_LEG, _LUMBAR = tuple(_TURNS)[:8], tuple(_TURNS)[8:]

JOINT_NAMES: tuple[str, ...] = (*(f"{side}_{joint}" for side in SIDES for joint in _LEG), *_LUMBAR)
"""The 19 joints in the order in which tables and arrays without names list them."""

MIRROR_SIGN = {"lumbar_bending": -1.0, "lumbar_rotation": -1.0}
"""Joints whose angle changes sign in a mirror; all others keep it and change sides."""

SEGMENT_NAMES: tuple[str, ...] = (
    "trunk",
    "pelvis",
    *(f"{side}_{segment}" for side in SIDES for segment in ("thigh", "shank", "hindfoot", "forefoot")),
)
"""The paper's ten segments; the trunk carries head and arms."""


@dataclass(frozen=True)
class BodyJoint:
    """A mechanical joint between two segments: one hinge, or a ball as three revolutes from the pelvis outwards."""

    name: str
    inner: str
    outer: str
    revolutes: tuple[str, ...]


def side_of(name: str) -> str | None:
    """`left`, `right`, or None for what lies on the midline."""
    side = name.split("_", 1)[0]
    return side if side in SIDES else None


def _plain(name: str) -> str:
    return name.split("_", 1)[1] if side_of(name) else name


def axis_of(name: str) -> np.ndarray:
    """Axis about which the outer segment turns when the joint's angle grows: (3,) unit vector, neutral posture."""
    axis = _AXES[_TURNS[_plain(name)]["axis"]].copy()
    return -axis if side_of(name) == "left" and abs(axis[1]) < 0.5 else axis


def joint_limits(name: str) -> tuple[float, float]:
    """Smallest and greatest angle, rad."""
    low, high = np.radians(RANGE_DEG[_plain(name)])
    return float(low), float(high)


def _leg_joints(side: str) -> list[BodyJoint]:
    def named(*parts: str) -> tuple[str, ...]:
        return tuple(f"{side}_{part}" for part in parts)

    thigh, shank, hindfoot, forefoot = named("thigh", "shank", "hindfoot", "forefoot")
    return [
        BodyJoint(f"{side}_hip", "pelvis", thigh, named(*_LEG[0:3])),
        BodyJoint(f"{side}_knee", thigh, shank, named(_LEG[3])),
        BodyJoint(f"{side}_ankle", shank, hindfoot, named(*_LEG[4:7])),
        BodyJoint(f"{side}_mtp", hindfoot, forefoot, named(_LEG[7])),
    ]


JOINTS: tuple[BodyJoint, ...] = (
    *_leg_joints("left"),
    *_leg_joints("right"),
    BodyJoint("lumbar", "pelvis", "trunk", JOINT_NAMES[16:]),
)
"""The nine joints of the paper's ten segments."""


def known_joint(name: str) -> str:
    """The name itself, if it is one of the 19.

    Raises
    ------
    InputError
        It is not; the message names the nearest.
    """
    if not isinstance(name, str) or name not in JOINT_NAMES:
        near = difflib.get_close_matches(str(name), JOINT_NAMES, n=1, cutoff=0.0)[0]
        raise InputError(f"unknown joint {name!r}; did you mean {near!r}?")
    return name


def names_of(given: str | Iterable[str]) -> list[str]:
    """Names as a list: one name alone, a list, a generator, or a set, which is taken in alphabetical order.

    Raises
    ------
    InputError
        Something that holds no names.
    """
    if isinstance(given, str):
        return [given]
    if not isinstance(given, Iterable):
        raise InputError(f"names are expected, got {shortened(given)}")
    return sorted(given, key=str) if isinstance(given, set | frozenset) else list(given)


def angles_array(angles: Mapping[str, float] | Sequence[float] | np.ndarray, order: Sequence[str]) -> NamedArray:
    """Joint values by name in the given order, (19,): of a mapping or an array with names, which may leave some out
    (they are 0), or of an array without names that is in this order.

    Raises
    ------
    InputError
        Unknown joint, or one that is not in the order; wrong number of values, or a value that is not finite.
    """
    if hasattr(angles, "keys"):
        given: dict[str, Any] = {known_joint(name): value for name, value in dict(angles).items()}
        try:
            values = np.array([float(given.get(name, 0.0)) for name in order])
            locked = [name for name, value in given.items() if name not in order and float(value)]
        except (TypeError, ValueError):
            raise InputError("a joint's value must be a number") from None
        if locked:
            raise InputError(f"{locked[0]} is not among the joints that move")
    else:
        values = numbers(angles, f"{len(order)} joint values")
        if values.shape != (len(order),):
            raise InputError(f"{len(order)} joint values were expected, got an array of shape {values.shape}")
    if not np.all(np.isfinite(values)):
        raise InputError(f"{order[int(np.argmin(np.isfinite(values)))]} must be a finite number")
    return NamedArray(values, order)


def mirrored(name: str) -> str:
    """The same joint of the other side; midline names stay."""
    side = side_of(name)
    return name if side is None else f"{SIDES[1 - SIDES.index(side)]}_{_plain(name)}"
