"""Walking with joints' torques, and with the stance foot at rest on the ground, as the paper has it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from fes_pin.body.gait import postures_of_walk
from fes_pin.body.joints import SIDES
from fes_pin.data.motion import OPTIONAL
from fes_pin.data.smooth import low_pass, rates
from fes_pin.walk.motion import Motion, has_rates
from fes_pin.walk.walk_trial import LOADED_N


def rooted_motion(free: Motion, columns: Mapping[str, np.ndarray], rows: slice) -> Motion:
    """The paper's motion in one single support: the stance forefoot rests flat on the ground, and only joints move.

    The stance ankle takes up what the foot turned, so that the other segments stand in space as measured; the forefoot
    keeps the mean of its place and heading.

    Parameters
    ----------
    free
        The motion of the body let go, whose `body.stance` is the foot that stands.
    columns
        Coordinates as in `motion_of`, on the same times.
    rows
        The samples of the single support.
    """
    taken = {f"q_{n}": np.zeros(len(free.time)) for n in OPTIONAL}
    for name in (n for n in columns if n.startswith("q_")):
        taken[name] = columns[name] if has_rates(columns) else low_pass(columns[name], free.dt)
    angles = np.asarray(postures_of_walk(taken, free.body.stance)[list(free.body.joint_names)])
    q, v, a = free.q[rows].copy(), np.zeros_like(free.v[rows]), np.zeros_like(free.a[rows])
    q[:, 7:], v[:, 6:], a[:, 6:] = (each[rows] for each in (angles, *rates(angles, free.time)))
    data = free.model.createData()
    foot = free.model.getFrameId(f"{free.body.stance}_forefoot")
    places = []
    for posture in free.q[rows]:
        pin.framesForwardKinematics(free.model, data, posture)
        places.append(data.oMf[foot].copy())
    ahead = np.mean([place.rotation[:, 0] for place in places], axis=0)
    middle = np.mean([place.translation for place in places], axis=0)
    level = pin.utils.rotate("z", float(np.arctan2(ahead[1], ahead[0])))
    q[:, :7] = pin.SE3ToXYZQUAT(pin.SE3(level, middle * [1.0, 1.0, 0.0]))
    return Motion(free.body, free.model, free.time[rows], q, v, a)


def joint_torques(
    motion: Motion, feet: Mapping[str, np.ndarray], residual_on: str = "pelvis"
) -> tuple[np.ndarray, np.ndarray]:
    """Torques of the 19 joints under a measured ground reaction, and what the measured reaction leaves to be made.

    A foot's reaction pushes the part that its centre of pressure lies under: the forefoot ahead of the MTP joint, the
    hindfoot behind it.

    Parameters
    ----------
    motion
        The motion.
    feet
        Ground reaction of `left` and `right`: (n, 6) force and moment about the world's origin.
    residual_on
        The segment that the residual wrench acts on, so that no joint between it and the feet carries that wrench.

    Returns
    -------
    torque
        (n, 19) N m in the order of `motion.body.joint_names`.
    left
        (n, 6) force and moment about the world's origin that the motion requires and no plate measured.
    """
    model, data = motion.model, motion.model.createData()
    torque, left = np.empty((len(motion.time), model.nv - 6)), np.empty((len(motion.time), 6))
    carrier = model.frames[model.getFrameId(residual_on)].parentJoint
    frames = {s: [model.getFrameId(f"{s}_{part}") for part in ("hindfoot", "forefoot")] for s in SIDES}
    for k, (q, v, a) in enumerate(zip(motion.q, motion.v, motion.a, strict=True)):
        pin.forwardKinematics(model, data, q)
        pin.updateFramePlacements(model, data)
        external = pin.StdVec_Force()
        external.extend(pin.Force.Zero() for _ in range(model.njoints))
        for side in SIDES:
            push = feet[side][k]
            joint = model.frames[frames[side][_part(model, data, side, push)]].parentJoint
            external[joint] = external[joint] + data.oMi[joint].actInv(pin.Force(push))
        missing = data.oMi[1].act(pin.Force(pin.rnea(model, data, q, v, a, external)[:6]))
        external[carrier] = external[carrier] + data.oMi[carrier].actInv(missing)
        torque[k], left[k] = pin.rnea(model, data, q, v, a, external)[6:], missing.vector
    return torque, left


def _part(model: pin.Model, data: pin.Data, side: str, push: np.ndarray) -> int:
    """0 where the reaction's centre of pressure lies under the hindfoot, 1 ahead of the MTP joint."""
    if push[2] <= 0.0:
        return 0
    hind, fore = (data.oMf[model.getFrameId(f"{side}_{part}")] for part in ("hindfoot", "forefoot"))
    ahead = hind.rotation[:, 0]
    joint = model.getJointId(f"{side}_mtp_extension")
    origin = data.oMi[joint].translation if joint > 1 else fore.translation
    pressure = np.array([-push[4] / push[2], push[3] / push[2], 0.0])
    return int(float(ahead[:2] @ (pressure - origin)[:2]) > 0.0)


def pressure_and_free_moment(wrench: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where a reaction pierces the ground z = 0, and its free moment about the vertical there.

    Parameters
    ----------
    wrench
        (n, 6) force and moment about the world's origin.

    Returns
    -------
    point, free
        (n, 2) m and (n,) N m; NaN where the vertical force is below 20 N.
    """
    up = np.where(wrench[:, 2] > LOADED_N, wrench[:, 2], np.nan)
    point = np.stack([-wrench[:, 4] / up, wrench[:, 3] / up], axis=1)
    return point, wrench[:, 5] - (point[:, 0] * wrench[:, 1] - point[:, 1] * wrench[:, 0])
