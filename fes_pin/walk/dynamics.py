"""Inverse dynamics of the whole body: the ground reaction that a motion requires, and its segments' share in it."""

import numpy as np
import pinocchio as pin

from fes_pin.body.joints import SEGMENT_NAMES
from fes_pin.walk.motion import Motion


def required(motion: Motion) -> np.ndarray:
    """Return the ground reaction that the motion requires: (n, 6) force, N, and moment about the world's origin, N m.

    It is given by the first six rows of Pinocchio's `rnea`, the efforts of the free joint, at the world's origin.
    """
    model, data = motion.model, motion.model.createData()
    root = (pin.rnea(model, data, q, v, a)[:6] for q, v, a in zip(motion.q, motion.v, motion.a, strict=True))
    return np.array([_root_pose(q).act(pin.Force(one)).vector for q, one in zip(motion.q, root, strict=True)])


def _root_pose(q: np.ndarray) -> pin.SE3:
    return pin.XYZQUATToSE3(q[:7])


def centre_of_mass(motion: Motion) -> np.ndarray:
    """Return the body's centre of mass: (n, 3) m."""
    data = motion.model.createData()
    return np.array([pin.centerOfMass(motion.model, data, q) for q in motion.q])


def about(wrench: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return the same wrench with its moment about another point: `wrench` (n, 6, ...), `point` (n, 3)."""
    arm = point.reshape(*point.shape, *(1,) * (wrench.ndim - 2))
    moved = wrench.copy()
    moved[:, 3:] -= np.cross(np.broadcast_to(arm, wrench[:, :3].shape), wrench[:, :3], axis=1)
    return moved


def segment_poses(motion: Motion) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return every segment's link frame: orientation (n, 3, 3) and origin (n, 3) m in the world."""
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
    """Return the required ground reaction per unit of each segment's mass parameters.

    It is given by the root's rows of Pinocchio's `computeJointTorqueRegressor`, carried to the world's origin.

    Returns
    -------
    dict of ndarray
        By segment, (n, 6, 10): columns m, m c (3), Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the link's origin, in its axes.
    """
    model, data = motion.model, motion.model.createData()
    rows = np.array(
        [
            _root_pose(q).toDualActionMatrix() @ pin.computeJointTorqueRegressor(model, data, q, v, a)[:6]
            for q, v, a in zip(motion.q, motion.v, motion.a, strict=True)
        ]
    )
    return {s: rows[:, :, 10 * (j - 1) : 10 * j] for s, j in _carriers(model).items()}


def segment_parameters(motion: Motion) -> dict[str, np.ndarray]:
    """Return each segment's ten mass parameters as believed, in the order of `segment_regressors`: (10,)."""
    inertias = motion.model.inertias
    return {s: inertias[j].toDynamicParameters() for s, j in _carriers(motion.model).items()}


def _carriers(model: pin.Model) -> dict[str, int]:
    """Return the joint of each segment."""
    return {s: model.frames[model.getFrameId(s)].parentJoint for s in SEGMENT_NAMES}
