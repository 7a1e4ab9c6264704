"""The table's greatest joint torques against those that healthy young men have been measured to make."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from yardsticks.strength import ANDERSON_2007, SARABON_2021, SUGIMOTO_2014, greatest_torque_nm

from fes_pin.body.gait import ankle_angles
from fes_pin.body.joints import JOINT_NAMES
from fes_pin.muscles.muscles import standard_muscles
from fes_pin.muscles.nerves import HEALTHY, SUBJECT_HEIGHT, SUBJECT_MASS, Nerves


@pytest.mark.parametrize("action", ANDERSON_2007)
def test_torque_over_angle_lies_where_people_lie(action):
    """Within two standard deviations of people at every angle, within a fifth of the peak on the whole."""
    curve = ANDERSON_2007[action]
    angles = curve.angles_deg()
    measured = curve.torque_nm(angles, SUBJECT_MASS, SUBJECT_HEIGHT)
    ours = greatest_torque_nm(standard_muscles(), curve, angles)
    assert np.abs(ours - measured).max() < 2 * curve.spread / curve.peak * measured.max()
    assert np.sqrt(np.mean((ours - measured) ** 2)) < 0.2 * measured.max()


@pytest.mark.parametrize(("action", "angle"), SARABON_2021)
def test_knee_agrees_with_a_pool_of_studies_that_took_no_part_in_the_fit(action, angle):
    low, high = (SUBJECT_MASS * value for value in SARABON_2021[action, angle])
    ours = greatest_torque_nm(standard_muscles(), ANDERSON_2007[action], [angle])[0]
    assert 0.85 * low < ours < 1.15 * high


def test_the_knee_extends_most_where_it_is_bent_and_much_less_where_it_is_straight():
    angles = np.linspace(-5.0, 105.0, 23)
    torque = greatest_torque_nm(standard_muscles(), ANDERSON_2007["knee extension"], angles)
    assert 35.0 < angles[np.argmax(torque)] < 75.0
    assert torque[angles == 0.0] < 0.75 * torque.max()


def test_the_calf_pushes_most_where_it_is_stretched():
    angles = np.linspace(-40.0, 30.0, 15)
    torque = greatest_torque_nm(standard_muscles(), ANDERSON_2007["plantarflexion"], angles)
    assert 0.0 <= angles[np.argmax(torque)] <= 20.0
    assert torque[0] < 0.4 * torque.max() and 90.0 < torque.max() < 170.0


def test_hip_abductors_make_what_sportsmen_make_at_speed():
    per_kg, spread, speed = SUGIMOTO_2014
    nerves = Nerves.muscles(*(n for n in Nerves().names if n.startswith("left_")), strength=HEALTHY)
    torque = nerves.torque_matrix(None, {"left_hip_adduction": -np.radians(speed)})
    ours = -np.minimum(torque[JOINT_NAMES.index("left_hip_adduction")], 0.0).sum()
    assert abs(ours / SUBJECT_MASS - per_kg) < 2 * spread


def test_supinators_weaken_from_the_everted_to_the_inverted_foot():
    """As measured about the subtalar axis, which is oblique: M. Hagen et al., J. Foot Ankle Res. 8:64, 2015."""
    muscles = Nerves.muscles("right_tibial", "right_deep_peroneal", strength=HEALTHY)
    joints = [f"right_ankle_{name}" for name in ("dorsiflexion", "inversion", "rotation")]

    def foot(angle):
        axis = np.array([0.78717961, 0.12094949, 0.60474746])  # of gait2354's subtalar joint, in our axes
        turned = pin.exp3(angle * axis / np.linalg.norm(axis))[None]
        return np.concatenate(ankle_angles(turned, "right"))

    torque = []
    for angle in np.radians(np.linspace(-20.0, 25.0, 7)):
        rate = (foot(angle + 1e-6) - foot(angle - 1e-6)) / 2e-6
        each = muscles.torque_matrix(dict(zip(joints, foot(angle), strict=True)))
        about = rate @ each[[JOINT_NAMES.index(joint) for joint in joints]]
        torque.append(np.maximum(about, 0.0).sum())
    assert (np.diff(torque) < 0.0).all() and 10.0 < max(torque) < 50.0


def test_the_story_prints_the_table_and_draws_it(tmp_path):
    root = Path(__file__).parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    command = [sys.executable, str(root / "analysis/joint_torques.py")]
    result = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=120
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout.count("\n") == 2 + 6 * 6 + len(SARABON_2021) + 3
    assert (tmp_path / "out/joint_torques.png").stat().st_size > 10_000
