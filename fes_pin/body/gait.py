"""Postures of the walk by name, and measured walking as postures of a body that stands on one forefoot."""

import math
from collections.abc import Mapping
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from fes_pin.body.anthropometry import HIP_SPACING
from fes_pin.body.joints import JOINT_NAMES, MIRROR_SIGN, SIDES, mirrored
from fes_pin.data.errors import InputError
from fes_pin.data.legs import turn
from fes_pin.data.named import NamedArray
from fes_pin.data.numbers import all_known, known_word
from fes_pin.data.table import own_table

TABLE = Path(__file__).with_name("gait_postures.csv")
"""Degrees, right stance; made by scripts/generate/gait_postures.py from the measured walk."""


@lru_cache(maxsize=1)
def _table() -> dict[str, dict[str, float]]:
    rows = own_table(TABLE)
    angles = [{n: float(np.radians(float(row[n]))) for n in JOINT_NAMES} for row in rows]
    return dict(zip([row["posture"] for row in rows], angles, strict=True))


STILL = ("neutral", "standing", "one_leg")
"""Postures in which one may stand still; every other named one is an instant of a walk, where the weight lies outside
the foot and is caught by the next step."""
BOTH_FEET = ("standing",)
"""Postures with both feet on the ground."""
_ONE_LEG_LEAN = math.atan(0.5 * HIP_SPACING / 0.5)
"""Ankle angle, rad, that brings half the hips' spacing over the stance foot; they stand half the body's height above
it (0.530 H to the hip less 0.039 H to the ankle: Winter, figure 4.1)."""


def posture_names() -> tuple[str, ...]:
    """The postures in which one may stand still, then those of the walk."""
    return (*STILL, *_table())


def posture_angles(name: str, stance: str) -> dict[str, float]:
    """Angles of a named posture, rad by joint name, for a body standing on that side.

    `neutral` is upright on one foot, `standing` the same on both, `one_leg` leans from the ankle until the weight is
    over the one foot; the others are measured instants of a walk.

    Raises
    ------
    InputError
        Unknown posture or side.
    """
    known_word(stance, SIDES, "stance")
    if name in STILL:
        angles = dict.fromkeys(JOINT_NAMES, 0.0)
        return {**angles, f"{stance}_ankle_inversion": -_ONE_LEG_LEAN} if name == "one_leg" else angles
    all_known([name], posture_names(), "posture")
    return dict(_table()[name]) if stance == "right" else mirror(_table()[name])


def mirror(angles: Mapping[str, float]) -> dict[str, float]:
    """A posture seen in a mirror: left and right change places."""
    return {mirrored(joint): MIRROR_SIGN.get(joint, 1.0) * angle for joint, angle in angles.items()}


# Axes of OpenSim's ankle and subtalar joints of the right leg (gait2354, `subject01_model.json`), in our axes.
_ANKLE_AXIS = np.array([-0.10501355, -0.97912632, -0.17402245])
_SUBTALAR_AXIS = np.array([0.78717961, 0.12094949, 0.60474746])


def ankle_angles(rotation: np.ndarray, side: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Dorsiflexion, inversion and rotation, in this order from the shank, that give rotations (N, 3, 3)."""
    inversion = -np.arcsin(np.clip(rotation[:, 1, 2], -1.0, 1.0))
    dorsiflexion = -np.arctan2(rotation[:, 0, 2], rotation[:, 2, 2])
    rotated = np.arctan2(rotation[:, 1, 0], rotation[:, 1, 1])
    return dorsiflexion, _sign(side) * inversion, _sign(side) * rotated


def _sign(side: str) -> float:
    """Return the sign of rotations about forward and upright axes: they are mirrored on the left."""
    return 1.0 if side == "right" else -1.0


def ankle_rotation(side: str, dorsiflexion: np.ndarray, inversion: np.ndarray, rotated: np.ndarray) -> np.ndarray:
    """Rotation of the hindfoot in the shank's frame, (N, 3, 3), of ankle angles, rad (N,); of a hip's angles alike."""
    forward, left, up = np.diag([_sign(side), 1.0, _sign(side)])
    return turn(-left, dorsiflexion) @ turn(forward, inversion) @ turn(up, rotated)


def ankle_torques(side: str, angles: np.ndarray, torques: np.ndarray, dorsiflexion, inversion) -> np.ndarray:
    """Torques about our ankle's dorsiflexion, inversion and rotation, (N, 3) N m, of torques about OpenSim's two axes.

    About the direction across both of OpenSim's axes that foot has no joint: bones carry what acts there, and it is
    taken as 0. Both torques do the same work in any motion about OpenSim's axes.

    Parameters
    ----------
    side
        `left` or `right`.
    angles, torques
        About OpenSim's ankle and subtalar axes: (N, 2) rad, (N, 2) N m.
    dorsiflexion, inversion
        Our angles of the same foot: (N,) rad (see `ankle_angles`).
    """
    forward, left, up = mirrored_axes = np.diag([_sign(side), 1.0, _sign(side)])
    first, second = (axis @ mirrored_axes / np.linalg.norm(axis) for axis in (_ANKLE_AXIS, _SUBTALAR_AXIS))
    theirs = np.stack([np.broadcast_to(first, (len(angles), 3)), turn(first, angles[:, 0]) @ second], axis=1)
    bent = turn(-left, dorsiflexion)
    inverted = bent @ turn(forward, inversion)
    ours = np.stack([np.broadcast_to(-left, (len(angles), 3)), bent @ forward, inverted @ up], axis=1)
    return (ours @ np.linalg.pinv(theirs) @ torques[..., None])[..., 0]


def postures_of_walk(coordinates: Mapping[str, np.ndarray], stance: str, flat_foot: bool = True) -> NamedArray:
    """Measured OpenSim coordinates as postures of our body: (N, 19) rad by joint name.

    Hips, knees, MTP and lumbar angles are the measured ones. (OpenSim's torso frame leans some 9 degrees against the
    line from hips to shoulders in this recording: a lumbar extension of -19 degrees is nearly upright.) OpenSim's
    oblique ankle and subtalar axes become the three angles of our ball of an ankle with the same rotation. Our stance
    forefoot lies flat on the ground, the measured one nearly so: with `flat_foot` the stance ankle takes up the
    difference, so that shank, pelvis and trunk stand in space as measured.

    Parameters
    ----------
    coordinates
        `q_hip_flexion_r` ... `q_lumbar_rotation` (with `q_pelvis_tilt`, `_list`, `_rotation` for `flat_foot`), rad,
        (N,).
    stance
        `left` or `right`.
    flat_foot
        Whether the stance ankle makes up for a stance forefoot that is not flat.

    Raises
    ------
    InputError
        A coordinate is missing or not finite, or another stance.
    """
    known_word(stance, SIDES, "stance")

    angles, measured = dict[str, np.ndarray](), partial(_coordinate, coordinates)
    for side in SIDES:
        s = side[0]
        for joint in ("hip_flexion", "hip_adduction", "hip_rotation"):
            angles[f"{side}_{joint}"] = measured(f"{joint}_{s}")
        angles[f"{side}_knee_flexion"] = -measured(f"knee_angle_{s}")
        angles[f"{side}_mtp_extension"] = measured(f"mtp_angle_{s}")
        axes = [axis * [_sign(side), 1.0, _sign(side)] for axis in (_ANKLE_AXIS, _SUBTALAR_AXIS)]
        foot = turn(axes[0], measured(f"ankle_angle_{s}")) @ turn(axes[1], measured(f"subtalar_angle_{s}"))
        if side == stance and flat_foot:
            foot = _flat_ankle(angles, pelvis_turns(coordinates), side, foot)
        ankle = (f"{side}_ankle_{name}" for name in ("dorsiflexion", "inversion", "rotation"))
        angles |= zip(ankle, ankle_angles(foot, side), strict=True)
    for joint in JOINT_NAMES[16:]:
        angles[joint] = measured(joint)
    return NamedArray(np.stack([angles[name] for name in JOINT_NAMES], axis=1), JOINT_NAMES)


def _coordinate(coordinates: Mapping[str, np.ndarray], name: str) -> np.ndarray:
    """A measured coordinate: (N,) finite numbers."""
    column = f"q_{name}"
    try:
        values = np.asarray(coordinates[column], dtype=float)
    except (KeyError, ValueError):
        raise InputError("the coordinate is missing", column=column) from None
    if values.ndim != 1 or not len(values):
        raise InputError("must be a row of samples", column=column)
    if not np.isfinite(values).all():
        raise InputError(f"sample {int(np.argmin(np.isfinite(values)))} is not a finite number", column=column)
    return values


def pelvis_turns(coordinates: Mapping[str, np.ndarray]) -> np.ndarray:
    """Orientation of the measured pelvis in the world: (N, 3, 3).

    Parameters
    ----------
    coordinates
        `q_pelvis_tilt`, `q_pelvis_list` and `q_pelvis_rotation`, rad, (N,).

    Raises
    ------
    InputError
        One of them is missing or not finite.
    """
    return ankle_rotation("right", *(_coordinate(coordinates, f"pelvis_{n}") for n in ("tilt", "list", "rotation")))


def _flat_ankle(angles: Mapping[str, np.ndarray], pelvis: np.ndarray, side: str, foot: np.ndarray) -> np.ndarray:
    """Rotation shank -> hindfoot that keeps the shank upright as measured, and the foot's heading, forefoot flat."""
    _, left, up = np.eye(3)
    hip = ankle_rotation(side, *(angles[f"{side}_hip_{name}"] for name in ("flexion", "adduction", "rotation")))
    shank = pelvis @ hip @ turn(left, angles[f"{side}_knee_flexion"])
    ahead = (shank @ foot)[:, :, 0]
    flat = turn(up, np.arctan2(ahead[:, 1], ahead[:, 0])) @ turn(left, angles[f"{side}_mtp_extension"])
    return np.swapaxes(shank, 1, 2) @ flat
