"""Ground contact: the area that carries the body, the centre of pressure in it, and a second foot.

The ground can push, not pull: the centre of pressure lies within the convex hull of the soles, and each foot's own
within its own sole (see `fes_pin.body.each_foot`). The total wrench of the
ground follows from the motion alone, f = m (a_com - g) and moment n about the origin; the centre of pressure is
(-n_y, n_x) / f_z in the plane of the foot (P. Sardain, G. Bessonnet, "Forces acting on a biped robot", IEEE Trans.
Syst. Man Cybern. A 34:630-637, 2004). Each edge of the hull is then one linear inequality of the wrench.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull

from fes_pin.body.anthropometry import ANKLE_ALONG_FOOT, FOOT_BREADTH, MTP_ALONG_FOOT
from fes_pin.body.build import Body
from fes_pin.body.joints import SIDES
from fes_pin.data.errors import InputError
from fes_pin.data.read_only import ReadOnly

FOOT_LENGTH = 0.2581 / 1.741
"""Length of the foot by height: de Leva's man."""
FLAT_DEG, LEVEL_M = 1.0, 0.005
"""A sole turned by less, and no further off the ground, rests on it: soles give way by some millimetres (ours)."""


@dataclass(frozen=True, eq=False)
class SupportPolygon(ReadOnly):
    """The area on the ground that carries a body.

    Parameters
    ----------
    corners
        Of the convex hull of the soles on the ground, counter-clockwise: (k, 2) m, in the plane of the stance foot.
    soles
        Which parts of the feet these are: `right_forefoot`, or `right_foot` where the heel is held down.
    """

    corners: np.ndarray
    soles: tuple[str, ...]

    @property
    def rows(self) -> np.ndarray:
        """Rows p with p (f, n) <= 0 for every wrench that the area can carry, the last f_z >= 0: (k + 1, 6)."""
        edges = np.roll(self.corners, -1, axis=0) - self.corners
        outward = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
        rows = np.zeros((len(edges) + 1, 6))
        rows[:-1, 2] = -(outward * self.corners).sum(axis=1)
        rows[:-1, 3], rows[:-1, 4] = outward[:, 1], -outward[:, 0]
        rows[-1, 2] = -1.0
        return rows

    def outside(self, point: np.ndarray) -> float:
        """Return the distance of a point (2,) m from the area, m; negative inside."""
        a, edges = self.corners, np.roll(self.corners, -1, axis=0) - self.corners
        along = np.clip(((point - a) * edges).sum(axis=1) / (edges**2).sum(axis=1), 0.0, 1.0)
        distance = float(np.linalg.norm(point - a - along[:, None] * edges, axis=1).min())
        inside = bool((edges[:, 0] * (point - a)[:, 1] - edges[:, 1] * (point - a)[:, 0] >= 0.0).all())
        return -distance if inside else distance


@dataclass(frozen=True, eq=False)
class Wrench(ReadOnly):
    """The ground's wrench (f, n) about the origin, N and N m, linear in small deviations and accelerations.

    Parameters
    ----------
    at_rest
        In the posture: (6,).
    per_angle, per_acceleration
        Its change with the joints' deviations and with their accelerations: (6, 19), joints in the body's order.
    per_torque
        Its change with the joints' torques beyond those of rest, C + D: (6, 19); none of all the ground's, which
        follows from the motion, but two feet share it by them.
    """

    at_rest: np.ndarray
    per_angle: np.ndarray = field(repr=False)
    per_acceleration: np.ndarray = field(repr=False)
    per_torque: np.ndarray = field(repr=False)

    def on(self, places: Sequence[int]) -> "Wrench":
        """With these of the joints alone."""
        moving = (self.per_angle, self.per_acceleration, self.per_torque)
        return Wrench(self.at_rest, *(part[:, places] for part in moving))

    def __sub__(self, other: "Wrench") -> "Wrench":
        """Return this wrench minus another one."""
        return Wrench(*(getattr(self, each.name) - getattr(other, each.name) for each in fields(self)))


def ground_wrench(model: pin.Model, q: np.ndarray) -> Wrench:
    """The wrench that carries a body about a posture at rest.

    Parameters
    ----------
    model
        The body's, with the gravity of the slope.
    q
        The posture, (19,) rad.
    """
    data = model.createData()
    momentum = pin.computeCentroidalMap(model, data, q).copy()
    jacobian = pin.jacobianCenterOfMass(model, data, q).copy()
    g, mass = model.gravity.linear, pin.computeTotalMass(model)
    foot = model.inertias[0]  # the stance forefoot, which Pinocchio leaves out of mass and centre: it never moves
    weight = -mass * g
    force, moment = -(mass + foot.mass) * g, np.cross(data.com[0], weight) - np.cross(foot.lever, foot.mass * g)
    along = np.cross(jacobian.T, weight).T
    turning = momentum[3:] + mass * np.cross(data.com[0], jacobian.T).T
    angle, rise = np.vstack([np.zeros_like(jacobian), along]), np.vstack([mass * jacobian, turning])
    return Wrench(np.concatenate([force, moment]), angle, rise, np.zeros((6, model.nv)))


def centre_of_pressure(wrench: np.ndarray) -> np.ndarray:
    """Return the point at which a wrench (6,) acts in the plane of the foot: (2,) m."""
    return np.array([-wrench[4], wrench[3]]) / wrench[2]


def _foot(body: Body, q: np.ndarray, side: str) -> tuple[np.ndarray, np.ndarray, float]:
    """The pose of a foot: rotation from the upright, its point under the MTP joint (3,) m; and its length, m."""
    data = body.model.createData()
    mtp, ankle = (body.model.getJointId(f"{side}_{name}") for name in ("mtp_extension", "ankle_dorsiflexion"))
    pin.forwardKinematics(body.model, data, np.zeros(body.model.nq))
    before, apart = data.oMi[mtp].copy(), data.oMi[mtp].translation - data.oMi[ankle].translation
    length = float(np.hypot(apart[0], apart[1])) / (MTP_ALONG_FOOT - ANKLE_ALONG_FOOT)
    under = before.translation * [0.0, 0.0, 1.0]
    if side == body.stance:
        return np.eye(3), before.translation - under, length
    pin.forwardKinematics(body.model, data, q)
    turn = data.oMi[mtp].rotation @ before.rotation.T
    return turn, data.oMi[mtp].translation - turn @ under, length


def sole(body: Body, q: np.ndarray, side: str, heel: bool) -> np.ndarray:
    """Corners of a sole, over the plane of the stance foot: (4, 3) m; the whole foot's, or without heel the forefoot's.

    Length and breadth by published proportions from the distance of the ankle and the MTP joint.
    """
    turn, place, length = _foot(body, q, side)
    half = 0.5 * FOOT_BREADTH / FOOT_LENGTH * length
    ends = (-MTP_ALONG_FOOT * length if heel else 0.0, (1.0 - MTP_ALONG_FOOT) * length)
    return np.array([[x, y, 0.0] for x in ends for y in (-half, half)]) @ turn.T + place


def support(body: Body, q: np.ndarray, heels: dict[str, bool], sides: Sequence[str]) -> SupportPolygon:
    """The area that carries a body.

    Parameters
    ----------
    q
        The posture, (19,) rad.
    heels
        By side: whether the MTP joint is held, so that a heel on the ground carries, too. A heel that is off the ground
        never does.
    sides
        The feet that carry.
    """
    names, points = [], []
    for side in sides:
        bent = abs(q[body.joint_names.index(f"{side}_mtp_extension")])
        heel = heels[side] and bent <= np.radians(FLAT_DEG)
        names.append(f"{side}_{'foot' if heel else 'forefoot'}")
        points.append(sole(body, q, side, heel)[:, :2])
    corners = np.vstack(points)
    return SupportPolygon(corners[ConvexHull(corners).vertices], tuple(names))


@dataclass(frozen=True)
class SecondFoot:
    """Effect of a second foot on the ground on a linearized body.

    Parameters
    ----------
    closure
        Jacobian of the second forefoot, which the ground holds: (6, 19); times the deviations it is 0.
    torque, stiffness
        Of the ground's force on it at the joints, (19,) N m, and its derivative by the angles, (19, 19) N m/rad.
    wrench
        That force: (f, n) about the origin, (6,) N and N m.
    place
        The point whose motion `closure` gives, (3,) m.
    """

    closure: np.ndarray
    torque: np.ndarray
    stiffness: np.ndarray
    wrench: np.ndarray
    place: np.ndarray


def second_foot(body: Body, model: pin.Model, q: np.ndarray) -> SecondFoot:
    """The second foot of a body that stands on both, each fixed to the ground as the first is.

    The ground's force on it is the share of the weight by the law of the lever between the feet, upright under the
    centre of mass; its torques are minus those of a weight that hangs there.

    Parameters
    ----------
    body, model
        The body, and its model with the gravity of the slope.
    q
        The posture, (19,) rad.

    Raises
    ------
    InputError
        The second foot is not flat on the ground.
    """
    side = SIDES[1 - SIDES.index(body.stance)]
    (_, first, _), (turn, second, _) = (_foot(body, q, each) for each in (body.stance, side))
    tilt, height = np.degrees(np.arccos(np.clip(turn[2, 2], -1.0, 1.0))), second[2]
    if tilt > FLAT_DEG or abs(height) > LEVEL_M:
        lies = f"it is tilted by {tilt:.1f} deg and {100 * height:+.1f} cm high"
        raise InputError(f"the {side} forefoot is not on the ground: {lies}", column="both_feet")
    data = model.createData()
    com = pin.centerOfMass(model, data, q).copy()
    pin.computeJointJacobians(model, data, q)
    joint = model.getJointId(f"{side}_mtp_extension")
    closure = pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED).copy()
    apart = second[1] - first[1]
    share = float(np.clip((com[1] - first[1]) / apart, 0.0, 1.0)) if abs(apart) > LEVEL_M else 0.5
    under = np.array([com[0], second[1], 0.0])
    lever = data.oMi[joint].actInv(under)
    loaded = pin.Model(model)
    weight = pin.Inertia(share * pin.computeTotalMass(model), lever, np.zeros((3, 3)))
    loaded.appendBodyToJoint(joint, weight, pin.SE3.Identity())
    torques, slopes = [], []
    for each in (model, loaded):
        work = each.createData()
        slopes.append(pin.computeGeneralizedGravityDerivatives(each, work, q).copy())
        torques.append(work.g.copy())
    force = -weight.mass * model.gravity.linear
    wrench = np.concatenate([force, np.cross(under, force)])
    place = data.oMi[joint].translation.copy()
    return SecondFoot(closure, torques[1] - torques[0], slopes[1] - slopes[0], wrench, place)
