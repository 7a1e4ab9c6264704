"""Zeros and scales of a recorded effort that differ between trials are reported as such, and then the causes alone."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from oracle import make_study
from typer.testing import CliRunner

import fes_pin as fp
from fes_pin.cli.main import app
from fes_pin.data.trial import Trial
from fes_pin.diagnosis import by_trial
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import fit_of
from fes_pin.identify.per_trial import amplitude, as_parameters, cross_fitted_unknowns
from fes_pin.infer.levels import CONFIDENCE_95
from fes_pin.infer.optimum import minimise
from fes_pin.models.effects import effect_named
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.models.simulate import Simulator
from fes_pin.models.store import load_model, model_toml

FRICTION = {"coulomb_friction": {"torque_nm": 0.03}}
RELAXATION = {"passive_relaxation": {"stiffness_nm_per_rad": 0.2, "relaxation_s": 0.4}}
ZEROS, SCALES = (0.1, -0.06, 0.04, -0.12), (0.85, 1.1, 1.2, 0.95)


def arm(seed, causes, zeros=(0.0,) * 4, scales=(1.0,) * 4):
    """A joint under an effort by scipy's integrator, of which the recorded effort is `scale effort + zero`."""
    study = make_study(np.random.default_rng([seed, 23]), "joint", causes, n_motion=len(zeros), duration_s=5.0)
    each = zip(study.trials, zeros, scales, strict=True)
    return replace(study, trials=tuple(t.with_columns(effort=s * t["effort"] + z) for t, z, s in each))


def are_within(cause, true):
    found = list(cause.parameters.values())
    assert [n for n in cause.parameters] == ["00", "01", "02", "03"]
    return all(abs(one.value - v) < 1.5 * CONFIDENCE_95 * one.std for one, v in zip(found, true, strict=True))


@pytest.mark.parametrize(("seed", "causes"), [(1, FRICTION), (2, RELAXATION), (3, {})])
def test_a_zero_of_each_trial_is_told_and_then_the_cause_alone(seed, causes):
    diagnosis = fp.diagnose(arm(seed, causes, ZEROS))
    first, *others = diagnosis.causes
    assert (first.name, first.site, first.trial) == ("zero_by_trial", "effort", None), str(diagnosis)
    assert are_within(first, ZEROS) and all(0.0 < one.std < 0.01 for one in first.parameters.values())
    assert first.gain_held_out.low > 0.0 and first.p_value < 1e-6
    assert [c.name for c in others] == list(causes) and not any(c.equivalents for c in others)
    assert f"the zero of effort differs between trials: 00 {first.parameters['00'].value:.3g}, 01 " in str(diagnosis)


@pytest.mark.parametrize(("zeros", "further"), [(ZEROS, True), ((0.0,) * 4, False)])
def test_a_zero_is_fitted_further_only_where_a_first_fit_gains(zeros, further, monkeypatch):
    asked = []
    fitted = by_trial.maximum_from
    monkeypatch.setattr(by_trial, "maximum_from", lambda one, trials: asked.append(one) or fitted(one, trials))
    found = fp.diagnose(arm(1, FRICTION, zeros))
    assert any(c.name == "zero_by_trial" for c in found.causes) is further
    assert bool(asked) is further


def test_a_scale_of_each_trial_is_told_and_then_the_cause_alone():
    diagnosis = fp.diagnose(arm(4, FRICTION, scales=SCALES))
    first, *others = diagnosis.causes
    assert first.name == "scale_by_trial" and are_within(first, SCALES), str(diagnosis)
    assert [c.name for c in others] == list(FRICTION)


def test_a_scale_is_relative_where_gravity_is_not_known():
    """Then the scale of all trials cannot be told from inertia, damping and gravity."""
    study = arm(5, {}, scales=SCALES)
    diagnosis = fp.diagnose(replace(study, start={**study.start, "gravity_scale": 1.0}))
    (cause,) = diagnosis.causes
    assert cause.name == "scale_by_trial" and "of their mean" in cause.words
    assert are_within(cause, np.array(SCALES) / np.mean(SCALES))


@pytest.mark.parametrize("seed", [6, 7])
@pytest.mark.parametrize("zero", [0.0, 0.08])
@pytest.mark.parametrize("causes", [{}, FRICTION, RELAXATION], ids=["none", "friction", "relaxation"])
def test_nothing_by_trial_is_told_where_all_have_one_zero(seed, zero, causes):
    diagnosis = fp.diagnose(arm(seed, causes, zeros=(zero,) * 4))
    assert not {"zero_by_trial", "scale_by_trial"} & {c.name for c in diagnosis.causes}, str(diagnosis)
    for name in (*causes, *["effort_offset"] * (zero > 0.0)):
        assert any(name in (c.name, *c.equivalents) for c in diagnosis.causes), str(diagnosis)


def test_the_answer_is_saved_with_the_values_of_each_trial(tmp_path):
    diagnosis = fp.diagnose(arm(3, {}, ZEROS))
    record = json.loads(json.dumps(diagnosis.record(), allow_nan=False))["causes"][0]
    assert set(record["parameters"]) == {"00", "01", "02", "03"} and record["parameters"]["00"]["unit"] == "N m"
    assert "differs between trials" in record["words"]
    path = tmp_path / "model.toml"
    path.write_text(model_toml(diagnosis.model))
    assert load_model(path).effects == diagnosis.model.effects and diagnosis.model.effects[0].is_fault
    fp.report(diagnosis, tmp_path / "report.html")
    assert "The zero of effort differs between trials" in (tmp_path / "report.html").read_text()


def turning(zero):
    """An arm without friction that a wave makes turn over, as recorded with a zero."""
    study = arm(8, {})
    model = fp.nominal_model(study).with_parameters({"damping": 0.02})
    time = np.arange(1200) / 200.0
    bare = Trial("00", "motion", {"effort": 0.8 * np.sin(5.0 * time)}, time, {"position0": 0.0, "velocity0": 0.0})
    (run,) = Simulator(model, [bare]).run(model.parameters())
    assert np.ptp(run.readings[:, 0]) > 2.0 * np.pi
    noise = 1e-3 * np.random.default_rng(0).standard_normal(len(time))
    read = Trial("00", "motion", {"effort": bare["effort"] + zero, "position": run.readings[:, 0] + noise}, time)
    return model + effect_named("effort_offset").of_each_trial(), read


def test_a_zero_is_found_from_either_half_of_a_trial_that_turns_over():
    model, trial = turning(0.2)
    for _, own in cross_fitted_unknowns(model, trial, StateSpaceNoise({"position": 1e-3})):
        assert own["effort_offset.offset"] == pytest.approx(-0.2, abs=0.005)


def test_unknowns_of_each_trial_as_parameters_have_the_covariance_of_the_whole():
    study = arm(9, {}, ZEROS)
    effect = effect_named("effort_offset").of_each_trial()
    model, noise = fp.nominal_model(study) + effect, StateSpaceNoise({"position": 2e-3})
    problem = LikelihoodProblem(model, study.trials, noise)
    fitted = fit_of(problem, minimise(problem, model.parameters()))
    found, count = as_parameters(fitted, effect), len(study.trials)
    assert np.allclose(found.covariance[:-count, :-count], fitted.covariance)
    values = np.array([found.values[n] for n in found.free[-count:]])
    assert np.allclose(values, -np.array(ZEROS), atol=0.01)
    size, std = amplitude(fitted, effect)
    assert abs(size - np.sqrt(np.mean(np.square(ZEROS)))) < 4.0 * std


@pytest.mark.shared
def test_zeros_of_a_torque_and_then_dry_friction_alone(shared, tmp_path):
    folder = shared / "cases/torque_zero_per_trial"
    if not folder.is_dir():
        pytest.skip(f"not there: {folder}")
    files = [shutil.copy(file, tmp_path) for file in sorted(folder.glob("*.csv"))]
    made = CliRunner().invoke(app, ["new-study", *map(str, files), "--rod", "0.4", "1.2"])
    assert made.exit_code == 0, made.output
    diagnosis = fp.diagnose(fp.read_study(tmp_path))
    first, second = diagnosis.causes
    assert (first.name, second.name, second.equivalents) == ("zero_by_trial", "coulomb_friction", ())
    for (low, high), true in zip((v.interval for v in first.parameters.values()), (0.25, -0.2, 0.1, -0.3), strict=True):
        assert low < true < high
    assert second.parameters["torque_nm"].value == pytest.approx(0.06, abs=0.002)
