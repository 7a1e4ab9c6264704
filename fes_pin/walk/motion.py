"""Measured walking as motion of the whole body, let go of the ground, and the ground reaction that it requires.

The motion comes from OpenSim's coordinates.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
import pinocchio as pin

from fes_pin.body.build import GRAVITY, Body
from fes_pin.body.gait import pelvis_turns, postures_of_walk
from fes_pin.body.joints import SEGMENT_NAMES
from fes_pin.body.skeleton import TO_WORLD
from fes_pin.data.errors import InputError
from fes_pin.data.motion import OPTIONAL, REQUIRED
from fes_pin.data.smooth import CUTOFF_HZ, low_pass, rates


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


_STEP = 1e-3
"""s; how far a sample's path is followed for its rates, by differences of fourth order: 1e-8 of the acceleration."""


@dataclass(frozen=True)
class Session:
    """The low pass and the treadmill with which a walk is read.

    Attributes
    ----------
    cutoff_hz
        Of the zero-phase low pass of plates, and of coordinates without rates, Hz.
    belt_speed_mps
        Speed of the belt, taken as walking over ground: its way is added to pelvis and centres of pressure.
    start_s
        Time at which that way is 0, s.
    heading_rad
        How far the walker faces to the left of the laboratory's x, rad: what is read is turned back by it, so that
        forward is where the walker faces, whatever way the laboratory's axes lie.
    """

    cutoff_hz: float = CUTOFF_HZ
    belt_speed_mps: float = 0.0
    start_s: float = 0.0
    heading_rad: float = 0.0

    @property
    def ahead(self) -> np.ndarray:
        """Forward in the laboratory's axes: (3,)."""
        return np.array([np.cos(self.heading_rad), np.sin(self.heading_rad), 0.0])

    @property
    def turn(self) -> np.ndarray:
        """Rotation of the laboratory's axes that has the walker face x: (3, 3)."""
        return np.array([self.ahead, np.cross([0.0, 0.0, 1.0], self.ahead), [0.0, 0.0, 1.0]])

    def way(self, time: np.ndarray) -> np.ndarray:
        """Return the way of the belt in the laboratory's axes: (n, 3) m."""
        return np.outer(self.belt_speed_mps * (time - self.start_s), self.ahead)


FACES, TURNS_ROUND = np.radians(20.0), 0.7
"""One who faces the laboratory's x within the first walks along it; the mean of the directions that one faces is
shorter than the second where one turns round, and then the laboratory's axes are kept."""


def heading_of(columns: Mapping[str, np.ndarray]) -> float:
    """How far a walker faces to the left of x in the mean, rad; 0 where it is little, or the walker turns round."""
    faced = np.mean(pelvis_turns(columns)[:, :2, 0], axis=0)
    angle = float(np.arctan2(faced[1], faced[0]))
    return angle if abs(angle) > FACES and np.linalg.norm(faced) > TURNS_ROUND else 0.0


def motion_of(
    body: Body, time: np.ndarray, columns: Mapping[str, np.ndarray], hip: np.ndarray, session: Session
) -> Motion:
    """The body's motion from OpenSim's coordinates.

    Rates and accelerations are the file's where it has both for every coordinate (`qd_`, `qdd_`), and then nothing is
    filtered; else coordinates are low-passed, and differentiated.

    Parameters
    ----------
    body
        The body.
    time, columns
        (n,) s; `q_<coordinate>`, and `qd_`, `qdd_` if known, (n,) in rad and m. What is optional and absent is 0.
    hip
        Right hip centre in OpenSim's pelvis, (3,) m; see `fes_pin.body.build.pelvis_to_hip`.
    session
        Low pass and treadmill.

    Raises
    ------
    InputError
        A coordinate is missing or not finite.
    """
    model, names = free_model(body), [n.removeprefix("q_") for n in columns if n.startswith("q_")]
    if absent := [n for n in REQUIRED if n not in names]:
        raise InputError("the coordinate is missing", column=f"q_{absent[0]}")
    place, rate, change = _paths(columns, time, names, session.cutoff_hz)
    level = [names.index("pelvis_tx"), names.index("pelvis_tz")]
    place[:, level] += session.way(time)[:, :2] * [1.0, -1.0]
    rate[:, level] += session.belt_speed_mps * session.ahead[:2] * [1.0, -1.0]
    moved = (place + step * rate + 0.5 * step**2 * change for step in (0.0, _STEP, -_STEP, 2.0 * _STEP, -2.0 * _STEP))
    q, *near = (_placed(body, model, dict(zip(names, m.T, strict=True)), hip) for m in moved)
    apart = np.array([list(map(partial(pin.difference, model), q, other)) for other in near])
    v = np.tensordot([8.0, -8.0, -1.0, 1.0], apart, 1) / (12.0 * _STEP)
    a = np.tensordot([16.0, 16.0, -1.0, -1.0], apart, 1) / (12.0 * _STEP**2)
    if session.heading_rad:
        back = pin.SE3(session.turn, np.zeros(3))
        q[:, :7] = [pin.SE3ToXYZQUAT(back * pin.XYZQUATToSE3(row)) for row in q[:, :7]]
    return Motion(body, model, np.array(time, dtype=float), q, v, a)


def has_rates(columns: Mapping[str, np.ndarray]) -> bool:
    """Return whether there are a rate and an acceleration of every coordinate."""
    names = [n.removeprefix("q_") for n in columns if n.startswith("q_")]
    return all(f"{kind}_{n}" in columns for kind in ("qd", "qdd") for n in names)


def _paths(columns: Mapping[str, np.ndarray], time: np.ndarray, names: list[str], cutoff_hz: float) -> list[np.ndarray]:
    """Return coordinates, rates and accelerations: (n, coordinates) each."""
    if has_rates(columns):
        return [np.stack([columns[f"{kind}_{n}"] for n in names], axis=1) for kind in ("q", "qd", "qdd")]
    raw = np.stack([np.asarray(columns[f"q_{n}"], dtype=float) for n in names], axis=1)
    smooth = low_pass(raw, float(time[-1] - time[0]) / (len(time) - 1), cutoff_hz)
    return [smooth, *rates(smooth, time)]


def _placed(body: Body, model: pin.Model, coordinates: dict[str, np.ndarray], hip: np.ndarray) -> np.ndarray:
    """The body where its pelvis is measured: (n, 26) as Pinocchio's q."""
    named = {f"q_{n}": values for n, values in coordinates.items()}
    for name in OPTIONAL:
        named.setdefault(f"q_{name}", np.zeros_like(named["q_pelvis_tx"]))
    angles = postures_of_walk(named, body.stance, flat_foot=False)
    side = np.array([1.0, 1.0, 1.0 if body.stance == "right" else -1.0])
    turns, origin = pelvis_turns(named), np.stack([named[f"q_pelvis_t{c}"] for c in "xyz"], axis=1) @ TO_WORLD.T
    origin = origin + turns @ (TO_WORLD @ (hip * side))
    q = np.tile(pin.neutral(model), (len(angles), 1))
    q[:, 7:] = angles[list(model.names[2:])]
    data, pelvis = model.createData(), model.getFrameId("pelvis")
    for row, turn, place in zip(q, turns, origin, strict=True):
        pin.framesForwardKinematics(model, data, row)
        row[:7] = pin.SE3ToXYZQUAT(pin.SE3(turn, place) * data.oMf[pelvis].inverse())
    return q
