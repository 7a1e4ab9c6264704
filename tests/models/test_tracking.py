"""What a servo adds along a motion is the effort that the model lacks, also of a rig that falls over."""

import numpy as np
import pytest
from view.reported import joint_study

from fes_pin.models.effects import effect_named
from fes_pin.models.free_run import TrackingEffort, can_track, measured_motion, tracking_effort
from fes_pin.models.model import Model
from fes_pin.models.nominal import nominal_model
from fes_pin.models.simulate import simulated_trial

A_FIFTH = 8e-4
"""Of the hidden effort; it is a thousandth of what the servo would ask for to hold the motion still."""


@pytest.fixture
def pendulum(tmp_path):
    study = joint_study(tmp_path)
    return nominal_model(study), study.trials[0].first(250)


@pytest.mark.parametrize("gravity", [1.0, -1.0], ids=["hanging", "upright"])
def test_the_effort_that_was_hidden_is_found(pendulum, gravity):
    model, trial = pendulum
    model = model.with_parameters({"gravity_scale": gravity})
    hidden = model + effect_named("effort_offset")(offset=0.004)
    measured = simulated_trial(hidden, trial)
    motion = measured_motion(measured, "position")
    inside = slice(40, -40)  # the servo has settled
    assert tracking_effort(model, measured, *motion)[inside] == pytest.approx(0.004, abs=A_FIFTH)
    assert tracking_effort(hidden, measured, *motion)[inside] == pytest.approx(0.0, abs=A_FIFTH)


def test_a_sensor_that_is_part_of_the_model_is_no_effort(pendulum):
    model, trial = pendulum
    skewed = model + effect_named("sensor_offset")(offset=0.05)
    measured = simulated_trial(skewed, trial)
    left = tracking_effort(skewed, measured, *measured_motion(measured, "position"))
    assert np.abs(left[40:-40]).max() < 3e-4
    wrong = tracking_effort(model, measured, *measured_motion(measured, "position"))
    assert np.abs(wrong[40:-40]).max() > 10 * np.abs(left[40:-40]).max()


def test_only_joints_are_tracked(pendulum):
    model, _ = pendulum
    assert can_track(model) and TrackingEffort.name not in {e.name for e in Model(model.rig).effects}


def test_a_short_trial_is_differenced(pendulum):
    _, trial = pendulum
    position, rate = measured_motion(trial.first(4), "position")
    assert len(position) == len(rate) == 4
