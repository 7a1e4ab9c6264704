"""Hum and breathing with a phase of each trial's own are named; with a common phase they keep the common form."""

import math

import numpy as np
import pytest
from diagnosis.hidden import SHORT, diagnosed, named, study_of

from fes_pin.identify.problem import limits_of
from fes_pin.models.effects import effect_named
from fes_pin.models.nominal import nominal_model
from fes_pin.models.predict import predict
from fes_pin.models.store import model_toml

HUM_RAD, HUM_N, BREATH_NM = 1.5e-3, 0.15, 0.006


def wave(size, hz, phase):
    return {"in_phase": size * math.cos(phase), "quadrature": size * math.sin(phase), "frequency_hz": hz}


def hum(number):
    """In the motions, and in the held trials by another amplifier."""
    return {"mains_hum": wave(HUM_RAD if number < SHORT["n_motion"] else HUM_N, 60.0, 2.4 * number)}


def hum_of_a_force(number):
    return {"mains_hum": wave(HUM_N, 50.0, 0.3 + 2.4 * number)}


def breath(number):
    return {"periodic_torque": wave(BREATH_NM, 0.33, 1.0 + 2.4 * number)}


ROWS = [  # rig, what is hidden, noise, driven, its size
    ("ankle", hum, "white", True, HUM_RAD),
    ("ankle", hum, "ar1", True, HUM_RAD),
    ("muscle", hum_of_a_force, "white", True, HUM_N),
    ("ankle", breath, "white", True, BREATH_NM),
    ("ankle", breath, "process", True, BREATH_NM),
    ("joint", breath, "white", False, BREATH_NM),
]


@pytest.mark.parametrize("row", range(len(ROWS)), ids=lambda k: f"{ROWS[k][0]}-{ROWS[k][1].__name__}-{ROWS[k][2]}")
def test_a_phase_of_each_trials_own(row):
    rig, hidden, noise, driven, size = ROWS[row]
    diagnosis = diagnosed(rig, hidden, noise, row, driven)
    (name,) = hidden(0)
    assert named(diagnosis) == [{name}], str(diagnosis)
    (cause,), (effect,) = diagnosis.causes, diagnosis.model.effects
    assert effect.each_trial
    assert not diagnosis.remainder.unexplained
    got = cause.parameters["amplitude"]
    assert abs(got.value - size) < 4.0 * got.std
    assert got.std < 0.15 * size
    assert cause.gain_held_out.low > 50.0
    assert "each trial" in str(diagnosis)
    assert set(diagnosis.record()["causes"][0]["parameters"]) == {"amplitude", "frequency_hz"}
    assert "each_trial = true" in model_toml(diagnosis.model)


def test_a_prediction_from_inputs_leaves_it_out():
    diagnosis = diagnosed("ankle", hum, "white", 0, True)
    trial = diagnosis.study.trials[0]
    quiet = predict(diagnosis.model - "mains_hum", trial)
    assert np.abs(predict(diagnosis.model, trial)["angle_rad"] - quiet["angle_rad"]).max() < 1e-9


@pytest.mark.parametrize(("rig", "name"), [("muscle", "mains_hum"), ("ankle", "periodic_torque")])
def test_a_common_phase_is_kept(rig, name):
    """The common form has two amplitudes for all trials, and foretells them in a trial that was not measured."""
    if rig == "muscle":
        diagnosis = diagnosed(rig, lambda _: hum_of_a_force(0), "white", 10, True)
    else:
        diagnosis = diagnosed(rig, (name,), "white", 11, True)
    assert named(diagnosis) == [{name}], str(diagnosis)
    (effect,) = diagnosis.model.effects
    assert not effect.each_trial
    assert {"in_phase", "quadrature"} <= set(diagnosis.causes[0].parameters)


def test_what_a_trial_holds_no_period_of_is_not_periodic():
    study = study_of("ankle", duration_s=4.0)
    limits = limits_of(nominal_model(study) + effect_named("periodic_torque")(), study.trials)
    assert limits["periodic_torque.frequency_hz"] == pytest.approx((0.25, 0.8), rel=0.01)
    assert effect_named("periodic_torque").grids({"time": study.trials[0].time})["frequency_hz"][0] == 0.3
    assert effect_named("periodic_torque").grids({"time": np.arange(0.0, 1.0, 0.1)})["frequency_hz"] == (0.8,)
