"""Inverse dynamics of the whole body against Simbody's, OpenSim's and the plates."""

import csv

import numpy as np
import pinocchio as pin
import pytest
from yardsticks.walking import joint_torques, pressure_and_free_moment, rooted_motion

from fes_pin.body.build import PELVIS_TO_HIP, Body
from fes_pin.body.skeleton import TO_WORLD
from fes_pin.data.errors import InputError
from fes_pin.walk.motion import Session, about, motion_of

pytestmark = pytest.mark.shared
CARRIERS = {"trunk": "torso", "pelvis": "pelvis", "right_thigh": "femur_r", "left_thigh": "femur_l"}
SLIDING = {f"{s}_{ours}": f"{theirs}_{s[0]}" for s in ("left", "right") for ours, theirs in (
    ("shank", "tibia"), ("hindfoot", "calcn"), ("forefoot", "toes"))}  # fmt: skip


def rms(values):
    return np.sqrt(np.mean(np.square(values), axis=0))


@pytest.fixture(scope="module")
def simbody(walk):
    """Required force and moment of the reference, in our axes: (n, 6)."""
    table = np.genfromtxt(walk / "reference/wholebody_mtpfree.csv", delimiter=",", names=True)
    parts = [np.array([table[f"{kind}_{c}"] for c in "xyz"]).T @ TO_WORLD.T for kind in ("Freq", "MreqO")]
    return np.hstack(parts)


@pytest.fixture(scope="module")
def tracks(walk):
    """Simbody's bodies: attitude, angular velocity and acceleration, centre's acceleration, in our axes."""
    with open(walk / "reference/bodies_mtpfree.csv") as file:
        rows = list(csv.DictReader(file))
    out = {}
    for body in {r["body"] for r in rows}:
        track = [r for r in rows if r["body"] == body]
        get = lambda *keys: np.array([[float(r[k]) for k in keys] for r in track])  # noqa: B023, E731
        turn = np.array([TO_WORLD @ pin.Quaternion(*q).matrix() @ TO_WORLD.T for q in get("qw", "qx", "qy", "qz")])
        omega, alpha, acc, place = (get(*(f"{kind}{c}" for c in "xyz")) @ TO_WORLD.T for kind in ("w", "al", "ac", "c"))
        out[body] = turn, omega, alpha, acc, place
    return out


def own_centre_accelerations(motion, segment):
    """Accelerations of a segment's centre of mass in our model: (n, 3)."""
    model, data = motion.model, motion.model.createData()
    frame = model.getFrameId(segment)
    joint = model.frames[frame].parentJoint
    out = []
    for q, v, a in zip(motion.q, motion.v, motion.a, strict=True):
        pin.forwardKinematics(model, data, q, v, a)
        lever = pin.SE3(np.eye(3), model.inertias[joint].lever)
        place = data.oMi[joint] * lever
        twist, change = lever.actInv(data.v[joint]), lever.actInv(data.a[joint])
        out.append(place.rotation @ (change.linear + np.cross(twist.angular, twist.linear)))
    return np.array(out)


def test_where_the_models_agree_segments_push_as_simbodys(measured, tracks):
    """Trunk, pelvis and thighs are the same bodies on the same joints: their share of the force is to 1 N RMS."""
    motion, _ = measured
    masses = {s: p[0] for s, p in motion.parameters.items()}
    share = sum(masses[ours] * (own_centre_accelerations(motion, ours) - tracks[theirs][3])
                for ours, theirs in CARRIERS.items())  # fmt: skip
    assert (rms(share) < 0.1).all()  # measured: 0.001 N


def test_the_rest_of_the_required_force_is_the_sliding_knee(measured, simbody, tracks):
    """Below the knee OpenSim's shank slides and its toes turn about an oblique axis: that is the whole difference."""
    motion, _ = measured
    ours = motion.required
    off = ours[:, :3] - simbody[:, :3]
    assert (rms(off) < [4.0, 1.0, 3.0]).all()  # measured: 3.7, 0.7, 2.8 N
    masses = {s: p[0] for s, p in motion.parameters.items()}
    below = 0.0
    for segment, theirs in SLIDING.items():
        turn, omega, alpha, acc, _ = tracks[theirs]
        apart = np.zeros(3)
        if segment.endswith("hindfoot"):  # holds the talus, which turns with it but for the subtalar joint
            continue
        arm = turn @ apart
        acc = acc + np.cross(alpha, arm) + np.cross(omega, np.cross(omega, arm))
        below = below + masses[segment] * (own_centre_accelerations(motion, segment) - acc)
    for side in "rl":
        name = {"r": "right", "l": "left"}[side]
        parts = sum(m * tracks[f"{b}_{side}"][3] for b, m in (("calcn", 1.20735026861049), ("talus", 0.0965880214888)))
        below = below + masses[f"{name}_hindfoot"] * own_centre_accelerations(motion, f"{name}_hindfoot") - parts
    assert (rms(off - below) < 0.1).all()
    assert (rms(ours[:, 3:] - simbody[:, 3:]) < [0.6, 2.5, 0.5]).all()  # measured: 0.4, 2.2, 0.3 N m


def test_required_reaction_does_not_depend_on_the_foot_that_the_tree_stands_on(measured, segments, hip):
    motion, columns = measured
    other = motion_of(Body.from_segments(segments, "left"), motion.time, columns, hip, Session())
    assert np.abs(other.required - motion.required).max() < 1e-4


def test_a_belt_changes_no_force(measured, segments, hip):
    motion, columns = measured
    moved = motion_of(
        Body.from_segments(segments), motion.time, columns, hip, Session(belt_speed_mps=1.135, start_s=motion.time[0])
    )
    assert np.abs(moved.required[:, :3] - motion.required[:, :3]).max() < 1e-4
    way = 1.135 * (motion.time - motion.time[0])
    assert np.allclose(moved.centre[:, 0] - motion.centre[:, 0], way, atol=1e-9)


def test_regressors_add_up_and_are_those_of_each_segment_alone(measured):
    motion, _ = measured
    part = motion.part(slice(0, 40, 7))
    regressors, parameters = part.regressors, part.parameters
    total = sum(regressors[s] @ parameters[s] for s in regressors)
    assert np.abs(total - part.required).max() < 1e-9
    model, data = motion.model, motion.model.createData()
    joint = model.frames[model.getFrameId("trunk")].parentJoint
    for k in range(len(part.time)):
        pin.rnea(model, data, part.q[k], part.v[k], part.a[k])
        pin.updateGlobalPlacements(model, data)
        carried = data.oMi[joint].toDualActionMatrix() @ pin.jointBodyRegressor(model, data, joint)
        assert np.allclose(carried, regressors["trunk"][k], atol=1e-9)


def test_joint_torques_are_opensims(with_plates, walk):
    """The lumbar joint to 1e-3 N m; in the legs OpenSim does not filter the plates, and its knee slides."""
    motion, plates = with_plates
    torque, left = joint_torques(motion, plates.feet)
    assert np.abs(left - (motion.required - plates.total)).max() < 1e-9
    table = np.genfromtxt(walk / "reference/grf_id_mtpfree.csv", delimiter=",", names=True)
    for ours, theirs, sign, within in (
        ("lumbar_extension", "lumbar_extension", 1, 1e-3),
        ("right_hip_flexion", "hip_flexion_r", 1, 4.0),
        ("left_hip_flexion", "hip_flexion_l", 1, 4.0),
        ("right_knee_flexion", "knee_angle_r", -1, 3.0),
        ("left_knee_flexion", "knee_angle_l", -1, 3.0),
        ("right_ankle_dorsiflexion", "ankle_angle_r", 1, 3.0),
    ):
        reference = sign * np.interp(motion.time, table["time"], table[f"ID_{theirs}_moment"])
        assert rms(torque[:, motion.body.joint_names.index(ours)] - reference) < within, ours


def test_required_reaction_in_single_support_is_near_the_plates(with_plates):
    motion, plates = with_plates
    needed = motion.required
    supports = plates.single_supports()
    assert [side for side, _ in supports] == ["left", "right", "left", "right"]
    ends = [(motion.time[rows.start], motion.time[rows.stop - 1]) for _, rows in supports]
    assert np.allclose(ends, [(0.174, 0.606), (0.798, 1.230), (1.422, 1.838), (2.030, 2.446)], atol=0.02)
    for side, rows in supports:
        assert (rms(needed[rows, :3] - plates.total[rows, :3]) < [20.0, 20.0, 25.0]).all()
        where, _ = pressure_and_free_moment(needed[rows])
        measured_at, free = pressure_and_free_moment(plates.feet[side][rows])
        assert (rms(where - measured_at) < [0.035, 0.045]).all()  # measured: up to 30 and 37 mm
        assert np.abs(free).max() < 15.0


def test_a_forefoot_that_rests_on_the_ground_costs_several_times_the_residual(with_plates, measured, walk):
    """The paper's root is the stance forefoot; measured feet roll on, so that tree needs 30 N or more elsewhere."""
    motion, plates = with_plates
    _, columns = measured
    inside = np.isin(measured[0].time, motion.time)
    own = {n: c[inside] for n, c in columns.items()}
    for side, rows in plates.single_supports():
        if side != motion.body.stance:
            continue
        rooted = rooted_motion(motion, own, rows)
        assert not rooted.v[:, :6].any()
        com = motion.centre[rows]
        measured_here = about(plates.total[rows], com)
        off = rms(about(rooted.required, com) - measured_here)
        free = rms(about(motion.required[rows], com) - measured_here)
        assert off[2] > 3.0 * free[2]


def test_segment_poses_are_simbodys(measured, tracks):
    poses = measured[0].poses
    for ours, theirs in CARRIERS.items():
        assert np.abs(poses[ours][0] - tracks[theirs][0]).max() < 1e-5


def test_a_hip_by_height_is_the_scaled_models(hip):
    assert np.allclose(PELVIS_TO_HIP * 1.80, hip, atol=1e-6)


def test_a_missing_coordinate_is_named(measured, segments, hip):
    motion, columns = measured
    with pytest.raises(InputError, match="q_knee_angle_l"):
        motion_of(Body.from_segments(segments), motion.time,
                  {n: c for n, c in columns.items() if n != "q_knee_angle_l"}, hip, Session())  # fmt: skip
