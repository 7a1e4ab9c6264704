"""Legs of a walker by rough proportions: where ankles and feet are by OpenSim's coordinates, to test conventions with.

What is compared is the same walk read by two conventions, so that proportions of a mean adult do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

HIP = np.array([-0.0402, -0.0376, 0.0475])
"""Right hip centre in OpenSim's pelvis, shares of the body's height: gait2354's for a height of 1.8 m."""
THIGH, SHANK, ANKLE = 0.245, 0.246, 0.039
"""Lengths, and height of the ankle, as shares of the body's height: D. A. Winter, "Biomechanics and Motor Control of
Human Movement", figure 4.1."""
AHEAD = 0.05
"""How far the middle of the sole lies ahead of the ankle, as a share of the body's height: a foot is 0.152 long, its
heel 0.03 behind the ankle (Winter, figure 4.1)."""
ADULT_M, HEIGHTS_M = 1.7, (0.8, 2.3)
"""Height, m, that is taken where a pelvis shows none that a person can have, between these."""
X, Y, Z = np.eye(3)


def turn(axis: Sequence[float] | np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rotations about an axis by angles (n,), rad: (n, 3, 3)."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle)[:, None, None] * cross + (1.0 - np.cos(angle))[:, None, None] * (cross @ cross)


@dataclass(frozen=True)
class Leg:
    """One leg, sample by sample, in OpenSim's axes.

    Attributes
    ----------
    ankle, sole
        (n, 3) m: the ankle, and a point ahead of it, above the middle of the sole.
    velocity
        (n, 3) m/s, of the ankle.
    spin
        (n, 3) rad/s, of the foot.
    """

    ankle: np.ndarray = field(repr=False)
    sole: np.ndarray = field(repr=False)
    velocity: np.ndarray = field(repr=False)
    spin: np.ndarray = field(repr=False)


def origin_of(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """The pelvis's origin: (n, 3) m."""
    return np.stack([columns[f"q_pelvis_t{c}"] for c in "xyz"], axis=1)


def pelvis_of(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Orientation of the pelvis: (n, 3, 3), its columns its axes in the laboratory."""
    tilt, lean, rotation = (columns[f"q_pelvis_{n}"] for n in ("tilt", "list", "rotation"))
    return turn(Z, tilt) @ turn(X, lean) @ turn(Y, rotation)


def leg_of(columns: Mapping[str, np.ndarray], time: np.ndarray, side: str, knee: float = 1.0) -> Leg:
    """One leg by the coordinates, rad and m, smoothed; `knee` is the sign that its angle is taken with."""
    from fes_pin.data.smooth import CUTOFF_HZ, low_pass  # noqa: PLC0415 - scipy

    mirror, pelvis, origin = (1.0 if side == "r" else -1.0), pelvis_of(columns), origin_of(columns)
    flexion, adduction, rotation = (columns[f"q_hip_{n}_{side}"] for n in ("flexion", "adduction", "rotation"))
    thigh = pelvis @ turn(Z, flexion) @ turn(mirror * X, adduction) @ turn(mirror * Y, rotation)
    shank = thigh @ turn(Z, knee * columns[f"q_knee_angle_{side}"])
    foot = shank @ turn(Z, columns[f"q_ankle_angle_{side}"])
    height = _height(origin)
    ankle = origin + height * (pelvis @ (HIP * [1.0, 1.0, mirror]) - THIGH * thigh[:, :, 1] - SHANK * shank[:, :, 1])
    both = np.hstack([ankle, foot.reshape(-1, 9)])
    step = float(time[-1] - time[0]) / (len(time) - 1)
    if len(time) > np.ceil(1.0 / (CUTOFF_HZ * step)):
        both = low_pass(both, step)
    rate = np.gradient(both, step, axis=0)
    turned = rate[:, 3:].reshape(-1, 3, 3) @ both[:, 3:].reshape(-1, 3, 3).transpose(0, 2, 1)
    spin = np.stack([turned[:, 2, 1], turned[:, 0, 2], turned[:, 1, 0]], axis=1)
    return Leg(both[:, :3], both[:, :3] + AHEAD * height * both[:, 3::3], rate[:, :3], spin)


def _height(origin: np.ndarray) -> float:
    """Height of the body, m, whose pelvis stands so high with straight legs."""
    height = float(np.median(origin[:, 1])) / (THIGH + SHANK + ANKLE - HIP[1])
    return height if HEIGHTS_M[0] < height < HEIGHTS_M[1] else ADULT_M
