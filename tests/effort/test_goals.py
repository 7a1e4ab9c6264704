"""A goal position in the column of the effort is taken as one, and no effort is."""

import numpy as np
import pytest
from bench import DAMPING, INERTIA, WEIGHT, study, trial
from driven_rigs.draw import draw
from driven_rigs.swing_up import draw_swing_up
from scipy.integrate import odeint

import fes_pin as fp

DT, SECONDS = 0.01, 6.0


def servo(seed, stiffness, friction=0.05, is_torque=False):
    """A joint that a position controller moves, integrated by LSODA: its goal, or its torque, and the position."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(SECONDS / DT)) * DT
    waves = zip(rng.uniform(0.5, 6.0, 3), rng.uniform(0.0, 6.0, 3), strict=True)
    goals = sum(0.3 * np.sin(w * time + phase) for w, phase in waves)
    state, read = np.array([goals[0], 0.0]), []

    def moves(x, _, goal):
        torque = stiffness * (goal - x[0]) - 0.05 * stiffness * x[1] - DAMPING * x[1] - WEIGHT * np.sin(x[0])
        return [x[1], (torque - friction * np.tanh(x[1] / 0.02)) / INERTIA]

    for goal in goals:
        read.append(state[0] + 3e-4 * rng.standard_normal())
        state = odeint(moves, state, [0.0, DT], args=(goal,))[-1]
    effort = stiffness * (goals - np.array(read)) if is_torque else goals
    return fp.Trial(f"{seed}", "motion", {"effort": effort, "position": np.array(read)}, time)


@pytest.mark.parametrize("stiffness", [4.0, 15.0, 60.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_goal_position_is_taken_as_one(seed, stiffness, tmp_path):
    goals = study(tmp_path, [servo(seed + 10 * k, stiffness) for k in range(2)])
    (said,) = (w for w in fp.check(goals).odd if "looks like a goal position" in w)
    assert float(said.split("an effort of ")[1].split(" ")[0]) == pytest.approx(stiffness, rel=0.15)


def test_friction_is_found_under_goals(tmp_path):
    """Dry friction of 0.05 N m under a controller of 15 N m/rad, whose damping of 0.75 N m s adds to the joint's."""
    found = fp.diagnose(study(tmp_path, [servo(10 * k, 15.0) for k in range(3)]))
    assert [c.name for c in found.causes] == ["coulomb_friction"]
    assert found.extended.values["coulomb_friction.torque_nm"] == pytest.approx(0.05, rel=0.25)
    assert found.extended.values["damping"] == pytest.approx(DAMPING + 0.75, rel=0.15)


def test_a_prediction_takes_no_goal_for_an_effort(tmp_path):
    goals = study(tmp_path, [servo(10 * k, 15.0) for k in range(2)])
    with pytest.warns(fp.InputWarning, match="looks like a goal position"):
        fp.predict(fp.nominal_model(goals), goals.trials[0])


@pytest.mark.parametrize("stiffness", [4.0, 15.0])
def test_the_torque_of_the_same_controller_is_one(stiffness, tmp_path):
    fp.check(study(tmp_path, [servo(3, stiffness, is_torque=True), servo(4, stiffness, is_torque=True)]))


@pytest.mark.parametrize("seed", range(3))
def test_no_controllers_torque_is_taken_for_a_goal(seed, tmp_path):
    fp.check(study(tmp_path, [trial(seed), trial(seed + 50)]))
    fp.check(fp.read_study(draw(("coulomb_friction",), 0.2, 7100 + seed, tmp_path / "a").study))
    fp.check(fp.read_study(draw_swing_up((), 7200 + seed, tmp_path / "b").study))
