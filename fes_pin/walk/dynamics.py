"""Inverse dynamics of the whole body: the ground reaction that a motion requires, and the torque of every joint."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from fes_pin.body.joints import SEGMENT_NAMES, SIDES
from fes_pin.walk.motion import Motion


def required(motion: Motion) -> np.ndarray:
    """The ground reaction that the motion requires: (n, 6) force, N, and moment about the world's origin, N m.

    The first six rows of Pinocchio's `rnea`, which push the free joint, carried to the world's origin.
    """
    out = np.empty((len(motion.time), 6))
    data = motion.model.createData()
    for k, (q, v, a) in enumerate(zip(motion.q, motion.v, motion.a, strict=True)):
        root = pin.Force(pin.rnea(motion.model, data, q, v, a)[:6])
        out[k] = pin.XYZQUATToSE3(q[:7]).act(root).vector
    return out


def centre_of_mass(motion: Motion) -> np.ndarray:
    """Where the body's centre of mass is: (n, 3) m."""
    data = motion.model.createData()
    return np.array([pin.centerOfMass(motion.model, data, q) for q in motion.q])


def about(wrench: np.ndarray, point: np.ndarray) -> np.ndarray:
    """The same wrench, its moment about another point: `wrench` (n, 6, ...), `point` (n, 3)."""
    arm = point.reshape(*point.shape, *(1,) * (wrench.ndim - 2))
    moved = wrench.copy()
    moved[:, 3:] -= np.cross(np.broadcast_to(arm, wrench[:, :3].shape), wrench[:, :3], axis=1)
    return moved


def segment_poses(motion: Motion) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Every segment's link frame: orientation (n, 3, 3) and origin (n, 3) m in the world."""
    model, data = motion.model, motion.model.createData()
    frames = {s: model.getFrameId(s) for s in SEGMENT_NAMES}
    turn = {s: np.empty((len(motion.time), 3, 3)) for s in frames}
    origin = {s: np.empty((len(motion.time), 3)) for s in frames}
    for k, q in enumerate(motion.q):
        pin.framesForwardKinematics(model, data, q)
        for s, frame in frames.items():
            turn[s][k], origin[s][k] = data.oMf[frame].rotation, data.oMf[frame].translation
    return {s: (turn[s], origin[s]) for s in frames}


def segment_regressors(motion: Motion) -> dict[str, np.ndarray]:
    """What each segment's mass parameters add to the required ground reaction.

    Pinocchio's `jointBodyRegressor`, carried to the world's origin: the root's rows of `computeJointTorqueRegressor`
    without its columns of zeros.

    Returns
    -------
    dict of ndarray
        By segment, (n, 6, 10): columns m, m c (3), Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the link's origin, in its axes.
    """
    model, data = motion.model, motion.model.createData()
    joints = {s: model.frames[model.getFrameId(s)].parentJoint for s in SEGMENT_NAMES}
    out = {s: np.empty((len(motion.time), 6, 10)) for s in SEGMENT_NAMES}
    for k, (q, v, a) in enumerate(zip(motion.q, motion.v, motion.a, strict=True)):
        pin.rnea(model, data, q, v, a)
        pin.updateGlobalPlacements(model, data)
        for name, joint in joints.items():
            out[name][k] = data.oMi[joint].toDualActionMatrix() @ pin.jointBodyRegressor(model, data, joint)
    return out


def segment_parameters(motion: Motion) -> dict[str, np.ndarray]:
    """Each segment's ten mass parameters as believed, in the order of `segment_regressors`: (10,)."""
    model = motion.model
    joints = {s: model.frames[model.getFrameId(s)].parentJoint for s in SEGMENT_NAMES}
    return {s: model.inertias[j].toDynamicParameters() for s, j in joints.items()}


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
        (n, 19) N m in the order of `motion.joint_names`.
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
