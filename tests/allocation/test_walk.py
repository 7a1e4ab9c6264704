"""Allocation along a motion, the rules of thumb beside it, and the measured walk."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from yardsticks.rules_of_thumb import clipped, direction_error, rescaled

from fes_pin.allocation.allocator import Allocator
from fes_pin.allocation.walk import allocate_walk
from fes_pin.body.joints import JOINT_NAMES
from fes_pin.body.measured_walk import data_folder, read_walk
from fes_pin.body.passive import ElasticJoints, PassiveLegs
from fes_pin.data.errors import InputError
from fes_pin.muscles.nerves import HEALTHY, Nerves

NERVES = Nerves(["left_femoral", "left_tibial", "left_hamstrings", "left_deep_peroneal", "left_iliopsoas"])


def motion(count=120, seed=0):
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 2, count)[:, None]
    q = 0.3 * np.sin(2 * np.pi * t + rng.uniform(0, 6, 19))
    return 40 * rng.normal(size=19) * np.sin(2 * np.pi * t + rng.uniform(0, 6, 19)), q


def test_every_sample_is_optimal_for_the_moment_arms_of_its_posture():
    torque, q = motion()
    walk = allocate_walk(torque, NERVES, q, change=0.01, dead=["left_iliopsoas"])
    assert walk.residual.max() <= 1e-11 and walk.recruitment[:, -1].max() == 0.0
    before = np.zeros(5)
    for k in range(120):
        np.testing.assert_allclose(walk.achieved[k], NERVES.torque_matrix(q[k]) @ walk.recruitment[k], atol=1e-9)
        one = walk.at(k)
        assert one.names == NERVES.names and isinstance(one.reasons, list)
        np.testing.assert_array_equal(one.previous, before)
        before = walk.recruitment[k]


def test_without_change_each_sample_is_what_it_would_be_alone():
    torque, q = motion()
    walk = allocate_walk(torque, NERVES, q, effort=1e-3)
    for k in range(0, 120, 7):
        price = 1e-3 * walk_scale(walk) / Allocator(NERVES, q[k]).problem.scale  # one scale for the whole motion
        alone = Allocator(NERVES, q[k], effort=price)(torque[k])
        np.testing.assert_allclose(walk.recruitment[k], alone.recruitment, atol=1e-9)


def walk_scale(walk):
    return max((m**2).sum(0).max() for m in walk.matrices)


def test_rules_of_thumb_stay_within_limits_and_never_have_less_torque_error():
    rng = np.random.default_rng(1)
    worse = 0
    for _ in range(200):
        matrix = rng.normal(size=(4, 6)) * 30
        torque = rng.normal(size=4) * 40
        best = Allocator(matrix, effort=1e-9)(torque).achieved
        for rule in (clipped, rescaled):
            r = rule(matrix, torque)
            assert (r >= 0).all() and (r <= 1).all()
            error = np.linalg.norm(matrix @ r - torque) - np.linalg.norm(best - torque)
            assert error >= -1e-5
            worse += error > 1.0
    assert worse > 200


def test_direction_error_is_an_angle():
    wanted = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 2.0], [1.0, 1.0]])
    got = np.array([[2.0, 0.0], [0.0, 3.0], [0.0, -1.0], [0.0, 0.0]])
    np.testing.assert_allclose(direction_error(wanted, got), [0.0, np.pi / 2, np.pi, np.pi / 2])


@pytest.mark.parametrize(
    "make",
    [
        lambda: allocate_walk(np.zeros((3, 18)), NERVES, np.zeros((3, 19))),
        lambda: allocate_walk(np.full((3, 19), np.nan), NERVES, np.zeros((3, 19))),
        lambda: allocate_walk(np.zeros((3, 19)), NERVES, np.full((3, 19), np.inf)),
        lambda: allocate_walk(np.zeros((0, 19)), NERVES, np.zeros((0, 19))),
        lambda: allocate_walk(np.zeros((3, 19)), NERVES, np.zeros((3, 19)), rate=0.1),
        lambda: allocate_walk(np.zeros((3, 19)), NERVES, np.zeros((3, 19)), least=0.1),
        lambda: read_walk("no/such/folder"),
    ],
)
def test_bad_input_is_one_clear_line(make):
    with pytest.raises(InputError) as caught:
        make()
    assert "\n" not in str(caught.value)


@pytest.mark.shared
def test_measured_walking_is_attained_by_the_nerves_of_the_leg_and_not_by_four():
    try:
        data_folder()
    except InputError:
        pytest.skip("the measured walk is not here")
    walk = read_walk()
    assert len(walk.time) == 157 and walk.known.sum() == 15
    knee, ankle = (JOINT_NAMES.index(f"right_{j}") for j in ("knee_flexion", "ankle_dorsiflexion"))
    assert walk.q[:, knee].max() == pytest.approx(1.2, abs=0.1)  # a knee flexes some 65 degrees in swing
    assert -150 < walk.torque[:, ankle].min() < -100  # push-off
    sagittal = [j for j in JOINT_NAMES if j.endswith(("hip_flexion", "knee_flexion", "ankle_dorsiflexion"))]
    weights = np.isin(JOINT_NAMES, sagittal).astype(float)
    legs = [n for n in Nerves().names if not n.endswith(("erector_spinae", "abdominals"))]
    four = [n for n in legs if n.split("_", 1)[1] in ("femoral", "hamstrings", "tibial", "deep_peroneal")]
    active, missed = walk.active(PassiveLegs()), []
    for nerves in (Nerves(legs, strength=HEALTHY), Nerves(four, strength=HEALTHY), Nerves(four)):
        result = allocate_walk(active.torque, nerves, walk.q, weights=weights)
        assert result.residual.max() < 1e-9
        missed.append(np.sqrt((result.shortfall[:, weights > 0] ** 2).sum(1).mean()))
    assert missed[0] < 1.0 < 4.0 < missed[1] < 10.0 < 20.0 < missed[2]  # N m; the last are paralysed


@pytest.mark.shared
def test_active_torque_is_inverse_dynamics_less_springs_and_dampers():
    try:
        walk = read_walk()
    except InputError:
        pytest.skip("the measured walk is not here")
    springs = ElasticJoints({"left_knee_flexion": 7.0}, {"left_knee_flexion": 0.5}, {"left_knee_flexion": 0.2})
    j, unknown = JOINT_NAMES.index("left_knee_flexion"), JOINT_NAMES.index("left_mtp_extension")
    active = walk.active(springs)
    rate = np.gradient(walk.q[:, j], walk.time)
    np.testing.assert_allclose(active.torque[:, j], walk.torque[:, j] + 7.0 * (walk.q[:, j] - 0.2) + 0.5 * rate)
    others = [i for i in range(19) if i != j]
    np.testing.assert_array_equal(active.torque[:, others], walk.torque[:, others])
    stiff = walk.active(ElasticJoints({"left_mtp_extension": 5.0}))
    assert not stiff.torque[:, unknown].any()  # what is not known stays so
    legs = walk.active(PassiveLegs())
    ankle = JOINT_NAMES.index("right_ankle_dorsiflexion")
    helped = (walk.torque - legs.torque)[:, ankle]
    assert -30.0 < helped.min() < -10.0 and helped.max() < 1.0  # a stretched calf pushes off by itself


@pytest.mark.shared
@pytest.mark.parametrize(
    ("story", "says"),
    [("allocate_walking", "with what paralysed muscle has"), ("allocate_ankle", "rms torque error")],
)
def test_story(story, says, tmp_path):
    try:
        data_folder()
    except InputError:
        pytest.skip("the measured walk is not here")
    root = Path(__file__).parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    command = [sys.executable, str(root / f"analysis/{story}.py")]
    result = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=300
    )
    assert result.returncode == 0, result.stderr
    assert says in result.stdout
    assert (tmp_path / f"out/{story}.png").stat().st_size > 10_000


@pytest.mark.parametrize("folder", ["", "none"])
def test_the_story_says_in_one_line_where_the_data_come_from(folder, tmp_path):
    root = Path(__file__).parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root), "FES_PIN_DATA": str(tmp_path / folder)}
    command = [sys.executable, str(root / "analysis/allocate_walking.py")]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=120)
    assert result.returncode == 2 and result.stdout == ""
    assert len(result.stderr.splitlines()) == 1
    assert "FES_PIN_DATA" in result.stderr and "opensim-org/opensim-models" in result.stderr
