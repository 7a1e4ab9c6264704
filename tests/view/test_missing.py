import numpy as np
import pytest
from view.reported import ankle_diagnosis, ankle_study, joint_study

from fes_pin.diagnosis.replay import replayed_trials
from fes_pin.models.effects import effect_named
from fes_pin.models.nominal import nominal_model
from fes_pin.models.simulate import simulated_trial
from fes_pin.view.missing import binned, missing_input, smooth


def missing_of(study, added, index=0):
    """What the true nominal model lacks in a trial that an effect has changed."""
    model = nominal_model(study)
    trial = study.trials[index]
    return missing_input(model.rig, simulated_trial(model + added, trial), simulated_trial(model, trial))


def test_missing_torque_of_a_spring_is_its_torque():
    missing = missing_of(
        ankle_study(), effect_named("parallel_stiffness")(stiffness_nm_per_rad=0.1, rest_angle_rad=1.8)
    )
    expected = -0.1 * (missing.against["angle"] - 1.8)
    moving = slice(20, -20)
    assert missing.unit == "N m"
    assert np.abs(missing.value - expected)[moving].max() < 0.05 * np.abs(expected).max()


def test_missing_torque_of_drag_opposes_the_rate(tmp_path):
    missing = missing_of(joint_study(tmp_path), effect_named("quadratic_damping")())
    rate = missing.against["rate"]
    expected = -effect_named("quadratic_damping")().coefficient * rate * np.abs(rate)
    assert np.corrcoef(missing.value[20:-20], expected[20:-20])[0, 1] > 0.98


def test_missing_input_of_a_prismatic_joint_is_a_force(tmp_path):
    missing = missing_of(joint_study(tmp_path, "prismatic"), effect_named("effort_offset")())
    assert (missing.kind, missing.unit) == ("force", "N")


def test_missing_force_of_an_isometric_trial_is_the_residual():
    missing = missing_of(ankle_study(), effect_named("fatigue")(rate_per_s=0.3), index=1)
    assert missing.unit == "N"
    assert missing.value.min() < -1.0
    assert "angle" not in missing.against


def test_smooth_leaves_the_noise_and_keeps_the_signal():
    time = np.linspace(0.0, 6.0, 1200)
    signal, noise = np.sin(3.0 * time), 0.2 * np.random.default_rng(2).standard_normal(1200)
    found = smooth(signal + noise)
    assert np.std(found - signal) < 0.4 * 0.2
    assert np.std(signal + noise - found) == pytest.approx(0.2, rel=0.1)


@pytest.mark.parametrize("values", [np.zeros(50), np.ones(5), np.linspace(0.0, 1.0, 40), np.full(13, 1e-12)])
def test_smooth_takes_what_has_no_noise(values):
    assert np.allclose(smooth(values), values, atol=1e-6)


def test_the_share_explained_is_one_of_a_function_and_small_of_noise():
    rng = np.random.default_rng(0)
    x = rng.uniform(-1.0, 1.0, 4000)
    share = binned(np.sign(x), x)[2]
    assert share > 0.95
    assert binned(1e200 * np.sign(x), x)[2] == share
    assert binned(rng.standard_normal(4000), x)[2] < 0.02
    assert binned(np.ones(10), np.zeros(10))[2] == 0.0
    at, medians, _ = binned(2.0 * x, x)
    assert np.allclose(medians, 2.0 * at) and (np.diff(at) > 0.0).all()


def test_a_replay_has_every_trial_in_order():
    diagnosis = ankle_diagnosis()
    replays = replayed_trials(diagnosis)
    assert [r.measured.name for r in replays] == [t.name for t in diagnosis.study.trials]
    assert all(r.errors["extended"] < r.errors["nominal"] for r in replays[:1])
