"""One trial of several was run under another load than it states: it is named, with the load; nothing else is."""

import json
from dataclasses import replace

import numpy as np
import pytest
from oracle import TYPICAL, make_study

import fes_pin as fp
from fes_pin.faults.misread import find_misread
from fes_pin.infer.levels import CONFIDENCE_95
from fes_pin.view.report import report_html


def misread_study(seed, share, noise="white", causes=()):
    """An ankle by scipy's integrator, and what one of its motions must have been loaded with; no misreading for 0."""
    rng = np.random.default_rng([seed, 17])
    hidden = {c: dict(TYPICAL[c]) for c in causes}
    study = make_study(rng, "ankle", hidden, noise, n_motion=6, n_isometric=3, duration_s=5.0)
    k = int(rng.integers(6))
    trial, trials = study.trials[k], list(study.trials)
    true = trial.conditions["load_kg"]
    trials[k] = replace(trial, conditions={"load_kg": true * (1.0 + share)})
    return replace(study, trials=tuple(trials)), trial.name, true


@pytest.mark.parametrize(("seed", "noise"), [(1, "white"), (2, "ar1"), (3, "process"), (4, "white")])
def test_the_trial_and_its_load_are_found(seed, noise):
    share = (-1.0) ** seed * 0.05 * seed
    study, name, true = misread_study(seed, share, noise)
    found = find_misread(fp.nominal_model(study), study.trials)
    assert (found.trial, found.condition) == (name, "load_kg")
    assert found.value == pytest.approx(true, abs=2.0 * CONFIDENCE_95 * found.std)
    assert found.std < 0.01 * true


@pytest.mark.parametrize(("seed", "noise"), [(5, "white"), (6, "ar1"), (7, "process"), (8, "white")])
def test_nothing_is_misread_where_nothing_was(seed, noise):
    study, _, _ = misread_study(seed, 0.0, noise)
    assert find_misread(fp.nominal_model(study), study.trials) is None


def test_trials_that_all_scatter_are_not_misread():
    """Loads that are all off by some percent, as of a bad balance: no trial stands out of the others."""
    study, _, _ = misread_study(9, 0.0)
    rng = np.random.default_rng(3)
    trials = [
        replace(t, conditions={n: v * (1.0 + 0.03 * rng.standard_normal()) for n, v in t.conditions.items()})
        for t in study.trials
    ]
    assert find_misread(fp.nominal_model(study), trials) is None


def test_a_bumped_sensor_is_no_load():
    """What is odd about one trial is not what another load would do."""
    study, name, _ = misread_study(10, 0.0)
    trials = [
        t.with_columns(angle_rad=t["angle_rad"] + 0.05 * np.sin(3.0 * t.time)) if t.name == name else t
        for t in study.trials
    ]
    assert find_misread(fp.nominal_model(study), trials) is None


def test_few_trials_say_nothing():
    study, _, _ = misread_study(1, 0.2)
    assert find_misread(fp.nominal_model(study), study.trials[:3]) is None


def test_a_diagnosis_names_the_trial_and_everything_else_is_told_with_its_value():
    study, name, true = misread_study(11, -0.12)
    diagnosis = fp.diagnose(study)
    (cause,) = diagnosis.causes
    assert (cause.name, cause.trial, cause.stage) == ("condition_misread", name, "rig")
    value = cause.parameters["load_kg"]
    assert value.value == pytest.approx(true, abs=CONFIDENCE_95 * value.std)
    assert cause.gain_held_out.low > 90.0
    assert diagnosis.nominal_error[0] > 3.0 * diagnosis.extended_error[0]
    assert diagnosis.model.effects == ()
    record = json.loads(json.dumps(diagnosis.record(), allow_nan=False))
    assert record["causes"][0]["trial"] == name
    assert f"trial {name}" in str(diagnosis)
    assert f"Trial {name} states load_kg = " in report_html(diagnosis)


@pytest.mark.long
def test_beside_another_cause_both_are_named():
    study, name, true = misread_study(12, 0.15, causes=("coulomb_friction",))
    diagnosis = fp.diagnose(study)
    assert {c.name for c in diagnosis.causes} == {"condition_misread", "coulomb_friction"}
    value = diagnosis.causes[0].parameters["load_kg"]
    assert diagnosis.causes[0].trial == name
    assert value.value == pytest.approx(true, abs=2.0 * CONFIDENCE_95 * value.std)


def test_a_cause_that_shows_at_one_load_is_named_as_what_it_is():
    """The load's own inertia shows most in the trial of the heaviest load; that is no misreading."""
    study, _, _ = misread_study(13, 0.0, causes=("load_inertia",))
    assert [c.name for c in fp.diagnose(study).causes] == ["load_inertia"]
