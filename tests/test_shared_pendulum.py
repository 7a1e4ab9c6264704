"""A real pendulum: its authors' model is viscous only; dry friction is what it lacks."""

import numpy as np
import pytest

from fes_pin.data.study import read_study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.models.predict import predict
from fes_pin.models.store import load_model, save_model

pytestmark = pytest.mark.shared

PROMISED = {"held_0": 0.009, "held_1": 0.015}
"""Open-loop RMS of the extended model from the first sample, rad, at most."""
PRINTED = {"held_0": (0.0135, 0.0038), "held_1": (0.0314, 0.0112)}
"""What the README says: of the nominal model and of the extended one."""


@pytest.fixture(scope="module")
def study(shared):
    return read_study(shared / "data/free_pendulum")


@pytest.fixture(scope="module")
def diagnosis(study):
    return diagnose_joint(study)


def rms(model, measured):
    """Of a prediction that sees the first sample alone."""
    first = {f"{n}0": float(measured[n][0]) for n in ("position", "velocity")}
    predicted = predict(model, Trial(measured.name, "motion", {}, measured.time, first))
    return float(np.sqrt(np.mean(measured.residual(predicted, "position") ** 2)))


def test_friction_or_drag_is_named(diagnosis):
    assert diagnosis.verdict == "causes_found"
    named = {n for c in diagnosis.causes for n in (c.name, *c.equivalents)}
    assert named & {"coulomb_friction", "quadratic_damping"}, str(diagnosis)


@pytest.mark.parametrize("name", PROMISED)
def test_the_nominal_model_misses_the_held_out_swings(study, diagnosis, name):
    missed = rms(diagnosis.nominal.model, study.trial(name))
    assert missed > PROMISED[name]
    assert missed == pytest.approx(PRINTED[name][0], abs=3e-4)


@pytest.mark.parametrize("name", PROMISED)
def test_the_extended_model_meets_them(study, diagnosis, tmp_path, name):
    save_model(diagnosis.model, tmp_path / "model.toml")
    missed = rms(load_model(tmp_path / "model.toml"), study.trial(name))
    assert missed <= PROMISED[name]
    assert missed == pytest.approx(PRINTED[name][1], abs=3e-4)
