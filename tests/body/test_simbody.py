"""The body against an independent multibody code: Simbody's mass matrix, gravity, energies and momenta."""

import csv
import json

import numpy as np
import pinocchio as pin
import pytest

from fes_pin.body.gait import postures_of_walk
from fes_pin.body.joints import JOINT_NAMES
from fes_pin.body.skeleton import read_segments

pytestmark = pytest.mark.shared
TO_WORLD = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
NEUTRAL_KNEE = np.array([-0.00516241539117801, -0.45410133579340550, 0.0])  # in the femur (subject01_model.json), m
SAME_JOINTS = [  # coordinates whose joints are the same in both models
    *("pelvis_tilt", "pelvis_list", "pelvis_rotation", "pelvis_tx", "pelvis_ty", "pelvis_tz"),
    *(f"hip_{motion}_{side}" for side in "rl" for motion in ("flexion", "adduction", "rotation")),
    *("lumbar_extension", "lumbar_bending", "lumbar_rotation"),
]


class FreeBody:
    """Our body let go of the ground: it takes states of the OpenSim model."""

    def __init__(self, body):
        self.stance = body.stance
        self.model = pin.buildModelFromXML(body.urdf, pin.JointModelFreeFlyer())
        self.model.gravity.linear = np.array([0.0, 0.0, -9.80665])
        self.data = self.model.createData()
        self.pelvis = self.model.getFrameId("pelvis")
        self.index = {n: i for i, n in enumerate(self.model.names[2:])}

    def state(self, q, qd, pelvis_centre):
        """Pinocchio's q and v for OpenSim coordinates; `pelvis_centre` is the pelvis link's origin in OpenSim's
        pelvis."""
        names = [f"q_{n}" for n in q]
        columns = np.array([[q[n], q[n] + 1e-6 * qd[n], q[n] - 1e-6 * qd[n]] for n in q])
        angles = postures_of_walk(dict(zip(names, columns, strict=True)), self.stance, flat_foot=False)
        joints, rates = angles[0], (angles[1] - angles[2]) / 2e-6
        order = [JOINT_NAMES.index(n) for n in self.index]
        place, twist = self._pelvis(q, qd, pelvis_centre)
        full_q = np.concatenate([[0, 0, 0, 0, 0, 0, 1.0], joints[order]])
        pin.framesForwardKinematics(self.model, self.data, full_q)
        root = place * self.data.oMf[self.pelvis].inverse()
        full_q[:7] = pin.SE3ToXYZQUAT(root)
        J = pin.computeFrameJacobian(self.model, self.data, full_q, self.pelvis, pin.LOCAL_WORLD_ALIGNED)
        v = np.concatenate([np.zeros(6), rates[order]])
        v[:6] = np.linalg.solve(J[:, :6], twist - J[:, 6:] @ v[6:])
        return full_q, v

    def _pelvis(self, q, qd, centre):
        def turn(axis, angle):
            return pin.exp3(TO_WORLD @ np.array(axis) * angle)

        tilt = turn([0, 0, 1], q["pelvis_tilt"])
        lean = tilt @ turn([1, 0, 0], q["pelvis_list"])
        whole = lean @ turn([0, 1, 0], q["pelvis_rotation"])
        omega = (
            TO_WORLD @ [0, 0, qd["pelvis_tilt"]]
            + tilt @ TO_WORLD @ [qd["pelvis_list"], 0, 0]
            + lean @ TO_WORLD @ [0, qd["pelvis_rotation"], 0]
        )
        arm = whole @ TO_WORLD @ centre
        origin = TO_WORLD @ [q["pelvis_tx"], q["pelvis_ty"], q["pelvis_tz"]]
        speed = TO_WORLD @ [qd["pelvis_tx"], qd["pelvis_ty"], qd["pelvis_tz"]] + np.cross(omega, arm)
        return pin.SE3(whole, origin + arm), np.concatenate([speed, omega])


@pytest.fixture(scope="module")
def reference(walk):
    return json.loads((walk / "reference/mass_matrix_gravity.json").read_text())


@pytest.fixture(scope="module")
def free(measured_body):
    return FreeBody(measured_body)


@pytest.fixture(scope="module")
def hip_centre(walk):
    table = json.loads((walk / "reference/subject01_model.json").read_text())
    return np.array(table["joints"]["hip_r"]["loc_in_parent"])


def mapped(free, reference, posture, hip_centre):
    """J with v = J qd at a posture, by unit rates."""
    names = reference["coordinate_order"]
    q = dict(zip(names, reference["postures"][posture]["q"], strict=True))
    still = dict.fromkeys(names, 0.0)
    columns = [free.state(q, {**still, name: 1.0}, hip_centre)[1] for name in SAME_JOINTS]
    return free.state(q, still, hip_centre)[0], np.array(columns).T


def test_mass_matrix_and_gravity_at_neutral_are_simbodys(free, reference, hip_centre):
    q, J = mapped(free, reference, "neutral", hip_centre)
    rows = [reference["coordinate_order"].index(n) for n in SAME_JOINTS]
    posture = reference["postures"]["neutral"]
    M = np.array(posture["M"])[np.ix_(rows, rows)]
    ours = J.T @ pin.crba(free.model, free.data, q) @ J
    assert np.abs(ours - M).max() < 1e-9 * np.abs(M).max()
    g = np.array(posture["gravity_vector(dPE/dq)"])[rows]
    ours = J.T @ pin.computeGeneralizedGravity(free.model, free.data, q)
    assert np.abs(ours - g).max() < 1e-9 * np.abs(g).max()


@pytest.mark.parametrize("posture", ["mid_stance_R_t1.00", "mid_swing_R_t1.60", "double_support_t1.30"])
def test_mass_matrix_in_walking_postures_is_simbodys_but_for_its_sliding_knee(free, reference, hip_centre, posture):
    """OpenSim's knee slides by some mm as it bends: that costs 0.11 % of the largest entry."""
    q, J = mapped(free, reference, posture, hip_centre)
    rows = [reference["coordinate_order"].index(n) for n in SAME_JOINTS]
    M = np.array(reference["postures"][posture]["M"])[np.ix_(rows, rows)]
    ours = J.T @ pin.crba(free.model, free.data, q) @ J
    assert np.abs(ours - M).max() < 0.0012 * np.abs(M).max()
    assert np.abs(ours - ours.T).max() < 1e-10


def test_energy_and_momenta_of_the_walk_are_simbodys(free, walk, hip_centre):
    """Kinetic energy, linear and angular momentum in every sample of two measured strides."""
    coordinates = np.genfromtxt(walk / "coords_mtpfree.csv", delimiter=",", names=True)
    whole = np.genfromtxt(walk / "reference/wholebody_mtpfree.csv", delimiter=",", names=True)
    names = [n[2:] for n in coordinates.dtype.names if n.startswith("q_")]
    assert np.abs(coordinates["time"] - whole["time"]).max() < 1e-9
    ours = []
    for row in coordinates:
        q, v = free.state({n: row[f"q_{n}"] for n in names}, {n: row[f"qd_{n}"] for n in names}, hip_centre)
        energy = pin.computeKineticEnergy(free.model, free.data, q, v)
        momentum = pin.computeCentroidalMomentum(free.model, free.data, q, v)
        ours.append([energy, *momentum.vector, *free.data.com[0]])
    ours = np.array(ours)
    turned = {key: np.array([whole[f"{key}_{c}"] for c in "xyz"]).T @ TO_WORLD.T for key in ("p", "Lcom", "com")}
    # What differs, and so how far the centre of mass may: OpenSim's knee slides (shank and foot, 5.1 of 72.6 kg), its
    # foot turns in inversion 0.072 m from the ankle's centre (1.42 kg), its toes about an oblique axis (0.62 rad; 0.21
    # kg, 0.04 m).
    off = np.linalg.norm(ours[:, 7:10] - turned["com"], axis=1)
    angle = {
        n: np.abs(coordinates[f"q_{n}_r"]) + np.abs(coordinates[f"q_{n}_l"]) for n in ("subtalar_angle", "mtp_angle")
    }
    may = 5.1 * knee_slide(walk) + 1.42 * 0.072 * angle["subtalar_angle"] + 0.21 * 0.04 * 0.62 * angle["mtp_angle"]
    assert np.all(off <= may / 72.6 + 1e-6)
    # The sliding knee, cm/s on a leg that swings at m/s, costs energy and momenta more: a check of signs and of the
    # tree, not of inertias; those follow segment by segment below.
    assert np.sqrt(np.mean((ours[:, 0] - whole["KE"]) ** 2)) < 0.038 * whole["KE"].mean()
    for columns, key, part in ((slice(1, 4), "p", 0.03), (slice(4, 7), "Lcom", 0.08)):
        size = np.sqrt(np.mean(np.sum(turned[key] ** 2, axis=1)))
        assert np.sqrt(np.mean(np.sum((ours[:, columns] - turned[key]) ** 2, axis=1))) < part * size, key


def test_energy_and_momenta_of_simbodys_motion_with_our_segments(measured_body, walk):
    """Our inertias carried along with Simbody's bodies: all but the foot's two parts are the same bodies."""
    carrier = {"trunk": "torso", "pelvis": "pelvis"}
    for side in ("left", "right"):
        pairs = {"thigh": "femur", "shank": "tibia", "hindfoot": "calcn", "forefoot": "toes"}
        carrier |= {f"{side}_{ours}": f"{theirs}_{side[0]}" for ours, theirs in pairs.items()}
    skeleton = read_segments(walk / "reference/subject01_model.json")
    mass = sum(segment.mass for segment in skeleton.segments.values())
    table = json.loads((walk / "reference/subject01_model.json").read_text())
    with open(walk / "reference/bodies_mtpfree.csv") as file:
        rows = list(csv.DictReader(file))
    whole = np.genfromtxt(walk / "reference/wholebody_mtpfree.csv", delimiter=",", names=True)
    energy, momentum, moment, centre = 0.0, 0.0, 0.0, 0.0
    for ours, theirs in carrier.items():
        track = [r for r in rows if r["body"] == theirs]
        get = lambda *keys: np.array([[float(r[k]) for k in keys] for r in track])  # noqa: B023, E731
        omega, speed = get("wx", "wy", "wz") @ TO_WORLD.T, get("vcx", "vcy", "vcz") @ TO_WORLD.T
        turn = np.array([TO_WORLD @ pin.Quaternion(*q).matrix() @ TO_WORLD.T for q in get("qw", "qx", "qy", "qz")])
        segment = skeleton.segments[ours]
        apart = (
            segment.com - TO_WORLD @ table["bodies"][theirs]["com_neutral_ground"]
        )  # the hindfoot holds the talus too
        speed = speed + np.cross(omega, turn @ apart)
        spin = np.einsum("nij,jk,nlk,nl->ni", turn, segment.inertia, turn, omega)
        energy = energy + 0.5 * segment.mass * np.sum(speed**2, axis=1) + 0.5 * np.sum(omega * spin, axis=1)
        momentum = momentum + segment.mass * speed
        place = get("cx", "cy", "cz") @ TO_WORLD.T + turn @ apart
        moment = moment + segment.mass * np.cross(place, speed) + spin
        centre = centre + segment.mass / mass * place
    assert np.abs(energy - whole["KE"]).max() < 0.001 * whole["KE"].mean()
    reference = np.array([whole["p_x"], whole["p_y"], whole["p_z"]]).T @ TO_WORLD.T
    assert np.abs(momentum - reference).max() < 0.001 * np.sqrt(np.mean(np.sum(reference**2, axis=1)))
    about_centre = moment - np.cross(centre, momentum)
    reference = np.array([whole["Lcom_x"], whole["Lcom_y"], whole["Lcom_z"]]).T @ TO_WORLD.T
    size = np.sqrt(np.mean(np.sum(reference**2, axis=1)))
    assert np.abs(about_centre - reference).max() < 0.001 * size


def knee_slide(walk):
    """How far both knees have slid from where they turn at neutral, summed: (N,) m."""
    with open(walk / "reference/bodies_mtpfree.csv") as file:
        rows = list(csv.DictReader(file))
    total = 0.0
    for side in "rl":
        femur, tibia = ([r for r in rows if r["body"] == f"{b}_{side}"] for b in ("femur", "tibia"))
        slid = []
        for f, t in zip(femur, tibia, strict=True):
            quaternion = pin.Quaternion(*(float(f[k]) for k in ("qw", "qx", "qy", "qz")))
            apart = np.array([float(t[k]) - float(f[k]) for k in ("ox", "oy", "oz")])
            slid.append(quaternion.matrix().T @ apart - NEUTRAL_KNEE)
        total = total + np.linalg.norm(slid, axis=1)
    return total


def test_every_segment_of_the_table_is_in_the_model(measured_body, walk):
    with open(walk / "reference/subject01_model.json") as file:
        table = json.load(file)["ten_segments"]
    masses = sorted(row["mass"] for row in table.values())
    assert np.allclose(sorted(i.mass for i in measured_body.model.inertias if i.mass > 0), masses, rtol=1e-14)


def test_reference_has_all_samples(walk):
    with open(walk / "reference/wholebody_mtpfree.csv") as file:
        assert len(list(csv.reader(file))) == 158
