"""Torques of muscles on the body itself: virtual work of forces between points of Pinocchio's links, joint by joint."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import CubicSpline

from fes_pin.body.anthropometry import Subject, skeleton_of_subject
from fes_pin.body.build import Body
from fes_pin.body.joints import JOINT_NAMES, SIDES
from fes_pin.muscles.muscles import standard_muscles
from fes_pin.muscles.nerves import HEALTHY, Nerves
from fes_pin.muscles.paths import read_table

LINKS = {"pelvis": "pelvis", "femur": "thigh", "tibia": "shank", "calcaneus": "hindfoot", "toes": "forefoot"}


def places():
    """Where each bone's frame begins in a right leg at rest (gait2392, subject01), and its ankle, from the pelvis."""
    shift = []
    for way in ("forward", "up"):
        rows = [row for row in read_table("knee.csv") if row["direction"] == way]
        angle, slide = ([float(row[key]) for row in rows] for key in ("knee_flexion_deg", "shift_mm"))
        shift.append(float(CubicSpline(angle, slide)(0.0)) / 1e3)
    hip = np.array([-0.07244, -0.06772, 0.08555])
    knee = hip + np.array([*shift, 0.0])
    ankle = knee + np.array([0.0, -0.425065, 0.0])
    heel = ankle + np.array([-0.0543287, -0.0467314, 0.00882271])
    mtp = heel + np.array([0.183643, -0.00205417, 0.00110925])
    return {"pelvis": np.zeros(3), "femur": hip, "tibia": knee, "calcaneus": heel, "toes": mtp, "ankle": ankle}


def ours(point, side):
    """From x forward, y up, z right of a right leg to x forward, y left, z up."""
    x, y, z = point
    return np.array([x, -z if side == "right" else z, y + 1.0])


def body_of_the_tables(stance):
    """A body whose legs have the joint centres of the tables."""
    skeleton, at = skeleton_of_subject(Subject(72.6, 1.80)), places()
    centres = dict(skeleton.centres)
    for side in SIDES:
        for joint, bone in (("hip", "femur"), ("knee", "tibia"), ("ankle", "ankle"), ("mtp", "toes")):
            centres[f"{side}_{joint}"] = ours(at[bone], side)
    return Body.from_segments(replace(skeleton, centres=centres, height=None), stance)


def always_passed():
    """Points of each muscle in the neutral posture of a straight knee: of what is passed in part, what is then."""
    at, patella = places(), {row["knee_flexion_deg"]: row for row in read_table("patella.csv")}["-0.000000"]
    points = {}
    for row in read_table("paths.csv"):
        if row["joint"] and float(row["from_deg"] or -np.inf) > 0.0:
            continue
        local = [float(row[f"{axis}_mm"] or patella.get(f"{row['muscle']}_{axis}_mm", 0.0)) / 1e3 for axis in "xyz"]
        bone = "tibia" if row["body"] == "patella" else row["body"]
        points.setdefault(row["muscle"], []).append((bone, at[bone] + local))
    return points


@pytest.mark.parametrize("stance", SIDES)
@pytest.mark.parametrize("side", SIDES)
def test_arms_are_those_of_forces_on_the_body_about_its_own_joints(stance, side):
    """Every muscle, every joint of the leg but the knee, whose bones slide: minus the length's slope."""
    body, table = body_of_the_tables(stance), standard_muscles()
    model, data = body.model, body.model.createData()
    pin.framesForwardKinematics(model, data, np.zeros(19))
    pelvis = data.oMf[model.getFrameId("pelvis")]
    hip = data.oMi[model.getJointId(f"{side}_hip_flexion")].translation
    origin = hip - (ours(places()["femur"], side) - ours(np.zeros(3), side))
    fixed = {}
    for muscle, points in always_passed().items():
        rows = []
        for bone, point in points:
            frame = model.getFrameId("pelvis" if bone == "pelvis" else f"{side}_{LINKS[bone]}")
            world = origin + ours(point, side) - ours(np.zeros(3), side)
            rows.append((frame, data.oMf[frame].actInv(world)))
        fixed[muscle] = rows
    assert np.allclose(pelvis.rotation, np.eye(3))

    def lengths(q):
        pin.framesForwardKinematics(model, data, body.angles(q, check=False))
        out = []
        for rows in fixed.values():
            world = np.array([data.oMf[frame].act(point) for frame, point in rows])
            out.append(np.linalg.norm(np.diff(world, axis=0), axis=1).sum())
        return np.array(out)

    rng, h = np.random.default_rng(3), 1e-5
    columns = [table.names.index(f"{side}_{muscle}") for muscle in fixed]
    for _ in range(3):
        low, high = [-20.0, -3.0, -3.0, 0.0, -40.0, -20.0, -18.0, -25.0], [12.0, 3.0, 3.0, 0.0, 35.0, 30.0, 18.0, 70.0]
        q = dict(zip([n for n in JOINT_NAMES if n.startswith(side)], np.radians(rng.uniform(low, high)), strict=True))
        arms = table.moment_arms(q)
        assert np.allclose(lengths(q), table.lengths(q)[columns], atol=1e-5)  # the tables' rounding
        for joint in (n for n in q if not n.endswith("knee_flexion")):
            slope = (lengths({**q, joint: q[joint] + h}) - lengths({**q, joint: q[joint] - h})) / (2.0 * h)
            found = arms[JOINT_NAMES.index(joint), columns]
            assert np.allclose(found, -slope, atol=1e-8), joint


@pytest.mark.parametrize(("muscle", "arm_mm"), [("soleus", -3.5), ("med_gas", -2.2), ("lat_gas", -4.3)])
def test_the_calf_everts_the_neutral_foot_about_its_own_axis(muscle, arm_mm):
    table = standard_muscles()
    arm = table.moment_arms()[JOINT_NAMES.index("left_ankle_inversion"), table.names.index(f"left_{muscle}")]
    assert 1e3 * arm == pytest.approx(arm_mm, abs=0.05)


def test_torques_of_the_ankle_about_the_bodys_axes():
    names = [f"right_{joint}" for joint in ("ankle_dorsiflexion", "ankle_inversion", "ankle_rotation")]
    rows = [JOINT_NAMES.index(name) for name in names]
    torque = Nerves(["right_tibial", "right_superficial_peroneal"], strength=HEALTHY).torque_matrix()[rows]
    assert torque[1, 0] < 0.1 * -torque[0, 0]
    assert torque[0, 1] == pytest.approx(-19.0, abs=0.1)
    assert (torque[2] != 0.0).all()
