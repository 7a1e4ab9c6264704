"""Named postures and measured walking on our body."""

import importlib.util
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from fes_pin.body.build import Body
from fes_pin.body.gait import (
    TABLE,
    ankle_angles,
    ankle_rotation,
    ankle_torques,
    mirror,
    posture_angles,
    posture_names,
    postures_of_walk,
)
from fes_pin.body.joints import JOINT_NAMES
from fes_pin.body.measured_walk import read_walk
from fes_pin.data.errors import InputError

AXES = np.array([-0.10501355, -0.97912632, -0.17402245]), np.array([0.78717961, 0.12094949, 0.60474746])
"""Of OpenSim's right ankle and subtalar joint, in our axes."""
SIX = ("initial_contact", "loading", "mid_stance", "terminal_stance", "pre_swing", "mid_swing")


def test_the_six_postures_are_there_and_within_limits():
    assert set(posture_names()) == {"neutral", "standing", "one_leg", *SIX}
    for stance in ("left", "right"):
        body = Body.from_subject(mass_kg=70.0, height_m=1.75, stance=stance)
        for name in posture_names():
            body.angles(name)
    swing = posture_angles("mid_swing", "right")
    assert swing["left_knee_flexion"] > np.radians(20) > swing["right_knee_flexion"]


@pytest.mark.shared
def test_the_table_is_the_measured_walk(walk):
    path = Path(__file__).parents[2] / "scripts/generate/gait_postures.py"
    spec = importlib.util.spec_from_file_location("gait_postures", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.table(walk) == TABLE.read_text()


@pytest.mark.shared
@pytest.mark.parametrize("stance", ["left", "right"])
def test_trunk_and_legs_stand_in_space_as_measured(walk, measured_body, stance):
    """In single support, with the forefoot laid flat: tilts of the trunk and of every leg segment as Simbody has
    them."""
    import csv

    import pinocchio as pin

    to_world = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    coordinates = np.genfromtxt(walk / "coords_mtpfree.csv", delimiter=",", names=True)
    postures = postures_of_walk({n: coordinates[n] for n in coordinates.dtype.names}, stance)
    body = Body.from_segments(walk / "reference/subject01_model.json", stance)
    with open(walk / "reference/bodies_mtpfree.csv") as file:
        rows = list(csv.DictReader(file))
    pairs = {"trunk": "torso", "pelvis": "pelvis"}
    pairs |= {f"{s}_{a}": f"{b}_{s[0]}" for s in ("left", "right") for a, b in (("thigh", "femur"), ("shank", "tibia"))}
    for k in range(0, len(coordinates), 10):
        angles = dict(zip(JOINT_NAMES, postures[k], strict=True))
        for ours, theirs in pairs.items():
            row = [r for r in rows if r["body"] == theirs][k]
            quaternion = pin.Quaternion(*(float(row[c]) for c in ("qw", "qx", "qy", "qz")))
            up = to_world @ quaternion.matrix() @ [0.0, 1.0, 0.0]  # the segment's long axis
            found = body.placement(ours, body.angles(angles, check=False))[0][:, 2]
            assert abs(up[2] - found[2]) < 1e-5, (ours, k)  # its tilt; heading is free


@pytest.mark.parametrize("side", ["left", "right"])
def test_ankle_angles_and_back(side):
    angles = np.random.default_rng(0).uniform(-0.6, 0.6, (3, 50))
    assert np.allclose(ankle_angles(ankle_rotation(side, *angles), side), angles, atol=1e-12)


def test_a_mirrored_posture_twice_is_itself():
    angles = {name: 0.01 * (i + 1) for i, name in enumerate(JOINT_NAMES)}
    assert mirror(mirror(angles)) == pytest.approx(angles)
    assert mirror(angles)["left_knee_flexion"] == angles["right_knee_flexion"]
    assert mirror(angles)["lumbar_bending"] == -angles["lumbar_bending"]


def test_missing_coordinates_say_so():
    with pytest.raises(InputError, match="q_hip_flexion_l"):
        postures_of_walk({}, "right")
    with pytest.raises(InputError, match="stance"):
        postures_of_walk({}, "both")


@pytest.mark.parametrize("side", ["left", "right"])
def test_ankle_torques_about_our_axes_do_the_work_of_those_about_opensims(side):
    mirror = np.array([1.0, 1.0, 1.0]) if side == "right" else np.array([-1.0, 1.0, -1.0])
    axes = [axis * mirror for axis in AXES]
    rng = np.random.default_rng(0)
    angles, torques = rng.uniform(-0.4, 0.4, (5, 2)), 50.0 * rng.normal(size=(5, 2))

    def ours(angles):
        turned = [
            pin.exp3(a * axes[0] / np.linalg.norm(axes[0])) @ pin.exp3(b * axes[1] / np.linalg.norm(axes[1]))
            for a, b in angles
        ]
        return np.stack(ankle_angles(np.array(turned), side), axis=1)

    dorsiflexion, inversion, _ = ours(angles).T
    found = ankle_torques(side, angles, torques, dorsiflexion, inversion)
    for k, step in enumerate(1e-6 * np.eye(2)):
        rates = (ours(angles + step) - ours(angles - step)) / 2e-6
        assert np.allclose((rates * found).sum(axis=1), torques[:, k], atol=1e-7)


def test_the_measured_walks_ankle_is_in_the_bodys_frames(walk):
    measured = read_walk(walk)
    theirs = np.genfromtxt(walk / "coords_mtpfree.csv", delimiter=",", names=True)
    names = ("ankle_dorsiflexion", "ankle_inversion", "ankle_rotation")
    found = ankle_rotation("right", *(measured.q[f"right_{name}"] for name in names))
    for row in (0, 100, -1):
        angles = theirs["q_ankle_angle_r"][row], theirs["q_subtalar_angle_r"][row]
        turned = [pin.exp3(q * axis / np.linalg.norm(axis)) for q, axis in zip(angles, AXES, strict=True)]
        assert np.allclose(found[row], turned[0] @ turned[1], atol=1e-9)
