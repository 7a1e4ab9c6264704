"""The body in its neutral posture: ten segments with mass, and the centres of the nine joints that hold them."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fes_pin.body.joints import JOINTS, SEGMENT_NAMES, SIDES
from fes_pin.data.errors import InputError, errors_of
from fes_pin.data.files import read_text
from fes_pin.data.numbers import numbers
from fes_pin.data.read_only import ReadOnly


@dataclass(frozen=True, eq=False)
class Segment(ReadOnly):
    """A rigid segment, given in the neutral posture in world axes (x forward, y left, z up).

    Parameters
    ----------
    mass
        kg.
    com
        Centre of mass, (3,) m.
    inertia
        About the centre of mass, (3, 3) kg m2.
    """

    mass: float
    com: np.ndarray
    inertia: np.ndarray

    def checked(self, name: str) -> "Segment":
        """Itself, if a real body can have these figures.

        Raises
        ------
        InputError
            Mass not positive, inertia not symmetric positive definite, or a principal moment above the sum of the
            others.
        """
        if not (np.isfinite(self.mass) and self.mass > 0.0):
            raise InputError(f"the mass must be positive, got {self.mass} kg", column=name)
        if self.com.shape != (3,) or self.inertia.shape != (3, 3):
            raise InputError("a segment needs a centre of mass (3) and an inertia (3 x 3)", column=name)
        if not (np.all(np.isfinite(self.com)) and np.all(np.isfinite(self.inertia))):
            raise InputError("centre of mass and inertia must be finite numbers", column=name)
        if np.abs(self.inertia - self.inertia.T).max() > 1e-9 * np.abs(self.inertia).max():
            raise InputError("the inertia must be symmetric", column=name)
        moments = np.linalg.eigvalsh(self.inertia)
        if moments[0] <= 0.0 or moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-9):
            raise InputError(f"no body has the principal moments {np.round(moments, 6).tolist()} kg m2", column=name)
        return self


@dataclass(frozen=True, eq=False)
class Skeleton(ReadOnly):
    """Ten segments and nine joint centres in the neutral posture, ground at z = 0.

    Parameters
    ----------
    segments
        By name (`SEGMENT_NAMES`).
    centres
        Joint centre by joint (`left_hip`, `left_knee`, ..., `lumbar`), (3,) m.
    points
        Further points for drawing and measuring: `left_heel`, `left_toe`, `vertex`, ...; (3,) m.
    height
        Standing height, m; None where only a table of segments is known.
    """

    segments: Mapping[str, Segment]
    centres: Mapping[str, np.ndarray]
    points: Mapping[str, np.ndarray]
    height: float | None = None

    def __post_init__(self) -> None:
        for name in SEGMENT_NAMES:
            if name not in self.segments:
                raise InputError(f"segment {name!r} is missing; the ten are {', '.join(SEGMENT_NAMES)}")
            self.segments[name].checked(name)
        for joint in JOINTS:
            if joint.name not in self.centres:
                raise InputError(f"the centre of joint {joint.name!r} is missing")
        self._freeze()

    @property
    def mass(self) -> float:
        """Total mass, kg."""
        return float(sum(segment.mass for segment in self.segments.values()))


TO_WORLD = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""OpenSim's axes (x forward, y up, z right) to ours (x forward, y left, z up)."""


def read_segments(path: str | Path) -> Skeleton:
    """Read a table of segments: JSON with `ten_segments` and `joints`, in OpenSim's axes, neutral posture.

    Each of `ten_segments` (`trunk`, `pelvis`, `thigh_right`, ...) has `mass` (kg), `com_ground_neutral` (m) and
    `inertia_com` (kg m2); each of `joints` (`hip_r`, `knee_r`, `ankle_r`, `mtp_r`, ..., `back`) has
    `centre_neutral_ground` (m). Knees turn about their neutral centre.

    Raises
    ------
    InputError
        The file cannot be read, or a segment or joint is missing or impossible.
    """
    try:
        table = json.loads(read_text(path))
    except (json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"cannot be read as a table of segments: {error}", file=path) from None
    with errors_of(path):
        return skeleton_of_table(table)


def skeleton_of_table(table: Mapping) -> Skeleton:
    """The skeleton of a table of segments as `read_segments` reads it.

    Raises
    ------
    InputError
        A key is missing or a value is not a number.
    """
    segments, centres = {}, {}
    for name in SEGMENT_NAMES:
        side, _, part = name.partition("_")
        place = "ten_segments", f"{part}_{side}" if side in SIDES else name
        segments[name] = Segment(
            mass=float(_numbers(table, *place, "mass", ())),
            com=TO_WORLD @ _numbers(table, *place, "com_ground_neutral", (3,)),
            inertia=TO_WORLD @ _numbers(table, *place, "inertia_com", (3, 3)) @ TO_WORLD.T,
        )
    for joint in JOINTS:
        side, _, part = joint.name.partition("_")
        key = f"{part}_{side[0]}" if side in SIDES else "back"
        centres[joint.name] = TO_WORLD @ _numbers(table, "joints", key, "centre_neutral_ground", (3,))
    return Skeleton(segments, centres, _foot_points(segments, centres))


def _foot_points(segments: Mapping[str, Segment], centres: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Heel, toe tip and the ground under a foot, guessed from its joints: for drawing only."""
    points = {}
    ground = 0.0
    for side in SIDES:
        ankle, mtp = centres[f"{side}_ankle"], centres[f"{side}_mtp"]
        length = (mtp[0] - ankle[0]) / (0.72 - 0.26)
        points[f"{side}_heel"] = np.array([ankle[0] - 0.26 * length, ankle[1], ground])
        points[f"{side}_toe"] = np.array([ankle[0] + 0.74 * length, mtp[1], ground])
    trunk, lumbar = segments["trunk"].com, centres["lumbar"]
    points["vertex"] = lumbar + 1.9 * (trunk - lumbar)
    return points


def _numbers(table: Mapping, group: str, key: str, field: str, shape: tuple[int, ...]) -> np.ndarray:
    """Numbers of one segment or joint: `table[group][key][field]`.

    Raises
    ------
    InputError
        There is no such entry, or it does not hold finite numbers of that shape.
    """
    try:
        given = table[group][key][field]
    except (KeyError, TypeError, IndexError):
        raise InputError("is missing in the table of segments", column=f"{group}.{key}.{field}") from None
    values = numbers(given, f"{key}.{field}")
    if values.shape != shape or not np.all(np.isfinite(values)):
        raise InputError(f"must be finite numbers of shape {shape}, got {values.shape}", column=f"{key}.{field}")
    return values
