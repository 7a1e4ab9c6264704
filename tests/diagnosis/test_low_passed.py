"""Readings that a laboratory low-passed before it stored them: the simulation is low-passed as well."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis.hidden import study_of
from scipy.signal import butter, sosfiltfilt

import fes_pin as fp
from fes_pin.data.smooth import low_pass
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.identify.recording import low_pass_of
from fes_pin.identify.stored import load_log
from fes_pin.models.nominal import nominal_model
from fes_pin.models.simulate import Simulator

TWICE = (2.0**0.5 - 1.0) ** 0.25
"""A second-order Butterworth filter that runs forwards and backwards passes half of the power here, of its design."""


def stored(study, hz):
    """The study with its readings as after such a filter, which is not the engine's code."""

    def passed(values, dt):
        return sosfiltfilt(butter(2, hz, fs=1.0 / dt, output="sos"), values)

    read = ("angle_rad", "force_n", "position")
    trials = [t.with_columns(**{n: passed(t[n], t.dt) for n in read if n in t}) for t in study.trials]
    return replace(study, trials=tuple(trials))


@pytest.mark.parametrize("hz", [15.0, 6.0])
@pytest.mark.parametrize(
    ("names", "within"), [((), 0.05), (("coulomb_friction",), 0.2), (("electromechanical_delay",), 0.2)], ids=str
)
def test_the_cut_off_is_found(names, within, hz):
    """Within a fifth where the nominal model, which it is sought with, misses a cause."""
    study = stored(study_of("ankle", names, seed=41), hz)
    assert low_pass_of(nominal_model(study), study.trials)[0] == pytest.approx(TWICE * hz, rel=within)


@pytest.mark.parametrize("noise", ["white", "ar1"])
@pytest.mark.parametrize("names", [(), ("coulomb_friction",), ("second_order_activation",)], ids=str)
def test_readings_as_they_were_read_have_none(names, noise):
    study = study_of("ankle", names, noise, seed=42)
    assert low_pass_of(nominal_model(study), study.trials) is None


def test_nothing_hidden_is_adequate_after_a_low_pass(tmp_path):
    """Before, a vibration of the frame was named: what the low pass took of the motion."""
    found = diagnose_joint(stored(study_of("ankle", seed=43), 6.0))
    assert found.verdict == "adequate", str(found)
    assert "low-passed at 4.8 Hz" in " ".join(found.warnings)
    (tmp_path / "model.toml").write_text(found.files()["model.toml"])
    log = load_log(tmp_path / "model.toml")
    assert log == found.log and log.low_pass_hz == pytest.approx(4.8, rel=0.05)


def test_what_is_simulated_is_low_passed_as_the_trial_was():
    study = study_of("ankle", seed=44)
    model, trial = nominal_model(study), study.trials[0]
    free, passed = (fp.simulate(model, t)["angle_rad"] for t in (trial, replace(trial, low_pass_hz=5.0)))
    np.testing.assert_allclose(passed, low_pass(free, trial.dt, 5.0))
    assert np.abs(passed - free).max() > 1e-3


def test_trials_of_different_lengths_are_low_passed_each_as_alone():
    """Side by side in lanes the short one is padded; its padding is no part of it."""
    study = study_of("ankle", seed=45)
    model, first = nominal_model(study), study.trials[0]
    short = replace(first, columns={n: v[:-150] for n, v in first.columns.items()}, time=first.time[:-150])
    trials = [replace(t, low_pass_hz=hz) for t, hz in ((first, 5.0), (short, 5.0), (short, 8.0), (first, None))]
    together = [one.readings[:, 0] for one in Simulator(model, trials).run(model.parameters())]
    for one, trial in zip(together, trials, strict=True):
        np.testing.assert_allclose(one, fp.simulate(model, trial)["angle_rad"], rtol=1e-12, atol=1e-12)
    assert np.abs(together[1] - together[2]).max() > 1e-4


def test_a_limit_of_time_holds_beside_a_low_pass():
    """Where it ends before the record is asked, the readings stay as they were recorded."""
    study = stored(study_of("ankle", ("coulomb_friction",), seed=46), 6.0)
    found = diagnose_joint(study, limit=0.0)
    assert any("stopped at its limit" in said for said in found.warnings)
    assert not any("low-passed" in said for said in found.warnings)
    assert all(t.low_pass_hz is None for t in found.extended.trials)
