"""Motion of a body that is let go of the ground, and its inverse dynamics: the ground reaction that it requires."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import pinocchio as pin

from fes_pin.body.build import GRAVITY, Body
from fes_pin.body.joints import SEGMENT_NAMES


def free_model(body: Body) -> pin.Model:
    """The body's model let go of the ground: a free joint under the stance forefoot, then the 19."""
    model = pin.buildModelFromXML(body.urdf, pin.JointModelFreeFlyer())
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    return model


@dataclass(frozen=True)
class Motion:
    """A body's motion, sample by sample.

    Attributes
    ----------
    body, model
        The body, and its model with a free joint at the stance forefoot.
    time
        (n,) s.
    q, v, a
        (n, 26), (n, 25), (n, 25) as Pinocchio has them: the free joint in its own frame, then the joints.
    """

    body: Body
    model: pin.Model = field(repr=False)
    time: np.ndarray = field(repr=False)
    q: np.ndarray = field(repr=False)
    v: np.ndarray = field(repr=False)
    a: np.ndarray = field(repr=False)

    @property
    def dt(self) -> float:
        """Time step, s."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)

    def part(self, rows: np.ndarray | slice) -> Motion:
        """Some of the samples."""
        return replace(self, time=self.time[rows], q=self.q[rows], v=self.v[rows], a=self.a[rows])

    @cached_property
    def required(self) -> np.ndarray:
        """The required ground reaction: (n, 6) force, N, and moment about the world's origin, N m.

        It is given by the first six rows of Pinocchio's `rnea`, the efforts of the free joint, at the world's origin.
        """
        model, data = self.model, self.model.createData()

        def carried(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
            return pin.XYZQUATToSE3(q[:7]).act(pin.Force(pin.rnea(model, data, q, v, a)[:6])).vector

        return np.array(list(map(carried, self.q, self.v, self.a)))

    @cached_property
    def centre(self) -> np.ndarray:
        """The body's centre of mass: (n, 3) m."""
        data = self.model.createData()
        return np.array([pin.centerOfMass(self.model, data, q) for q in self.q])

    @cached_property
    def poses(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Every segment's link frame: orientation (n, 3, 3) and origin (n, 3) m in the world."""
        model, data = self.model, self.model.createData()
        placed = []
        for q in self.q:
            pin.framesForwardKinematics(model, data, q)
            placed.append([data.oMf[model.getFrameId(s)].homogeneous for s in SEGMENT_NAMES])
        each = np.array(placed).transpose(1, 0, 2, 3)
        return {s: (one[:, :3, :3], one[:, :3, 3]) for s, one in zip(SEGMENT_NAMES, each, strict=True)}

    @cached_property
    def regressors(self) -> dict[str, np.ndarray]:
        """The required ground reaction per unit of each segment's mass parameters.

        By segment, (n, 6, 10): columns m, m c (3), Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the link's origin, in its axes.
        They are the root's rows of Pinocchio's `computeJointTorqueRegressor`, carried to the world's origin.
        """
        model, data = self.model, self.model.createData()

        def carried(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
            turned = pin.XYZQUATToSE3(q[:7]).toDualActionMatrix()
            return turned @ pin.computeJointTorqueRegressor(model, data, q, v, a)[:6]

        rows = np.array(list(map(carried, self.q, self.v, self.a)))
        return {s: rows[:, :, 10 * (j - 1) : 10 * j] for s, j in self._carriers().items()}

    @cached_property
    def parameters(self) -> dict[str, np.ndarray]:
        """Each segment's ten mass parameters as believed, in the order of `regressors`: (10,)."""
        return {s: self.model.inertias[j].toDynamicParameters() for s, j in self._carriers().items()}

    def _carriers(self) -> dict[str, int]:
        """Return the joint of each segment."""
        return {s: self.model.frames[self.model.getFrameId(s)].parentJoint for s in SEGMENT_NAMES}


def about(wrench: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return the same wrench with its moment about another point: `wrench` (n, 6, ...), `point` (n, 3)."""
    arm = point.reshape(*point.shape, *(1,) * (wrench.ndim - 2))
    moved = wrench.copy()
    moved[:, 3:] -= np.cross(np.broadcast_to(arm, wrench[:, :3].shape), wrench[:, :3], axis=1)
    return moved
