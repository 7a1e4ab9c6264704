"""Efforts that were recorded with noise, as measured currents are: noise moves nothing, and is no friction."""

import json
from dataclasses import dataclass, replace

import numpy as np
import pytest
from driven_rigs import swing_up
from driven_rigs.swing_up import SwingUp, draw_swing_up

from fes_pin.data.study import read_study
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.identify.stored import load_log

NOISY = (1830000, 1830006)
"""Pendulums whose effort is read with noise of a hundredth of it, by 4 and 1 ms."""


@pytest.fixture
def acted(monkeypatch):
    """The efforts that acted, by run of a bench."""
    kept, run = [], SwingUp.run

    def kept_run(self, rng):
        kept.append(run(self, rng))
        return kept[-1]

    monkeypatch.setattr(SwingUp, "run", kept_run)
    return kept


@pytest.mark.parametrize("seed", NOISY)
def test_the_noise_of_an_effort_is_no_friction(seed, acted, tmp_path):
    """Before, dry friction was named beside a pendulum that hides none, by 114 in twice the log-likelihood."""
    study = read_study(draw_swing_up((), seed, tmp_path).study)
    noise = np.std([study.trials[0]["effort"] - acted[-1][0][:, 0]])
    found = diagnose_joint(study)
    assert found.verdict == "adequate", str(found)
    assert found.log.effort_noise == pytest.approx(noise, rel=0.1)
    assert any("recorded with noise" in said for said in found.warnings)
    for name, text in found.files().items():
        (tmp_path / name).write_text(text)
    assert load_log(tmp_path / "model.toml") == found.log
    assert json.loads((tmp_path / "diagnosis.json").read_text())["log"]["effort_noise"] > 0.0


def test_friction_beside_the_noise_is_found(tmp_path):
    """With noise of a fiftieth of the effort, which the test adds; friction's size is as it is without."""
    study = read_study(draw_swing_up(("coulomb_friction",), NOISY[0], tmp_path).study)
    noise, rng = 0.02 * float(np.std(study.trials[0]["effort"])), np.random.default_rng(0)
    noisy = [t.with_columns(effort=t["effort"] + noise * rng.standard_normal(len(t))) for t in study.trials]
    plain, found = (diagnose_joint(s) for s in (study, replace(study, trials=tuple(noisy))))
    assert plain.log.effort_noise == 0.0
    assert found.log.effort_noise == pytest.approx(noise, rel=0.1)
    for one in (plain, found):
        assert [c.name for c in one.causes][:1] == ["coulomb_friction"], str(one)
    sizes = [one.causes[0].parameters["torque_nm"] for one in (plain, found)]
    assert sizes[1].value == pytest.approx(sizes[0].value, abs=3.0 * sizes[1].std)


@dataclass
class Shaken(SwingUp):
    """A controller that shakes its rig a little: what no reading foretells acts, and is recorded as it is."""

    def command(self, error, rate, read, wanted, wanted_rate, wanted_bend):
        asked = super().command(error, rate, read, wanted, wanted_rate, wanted_bend)
        return asked + 0.02 * self.hidden["most"] * np.random.default_rng(self.pushed_for).standard_normal(len(asked))


def test_what_acted_is_not_taken_for_noise(monkeypatch, tmp_path):
    monkeypatch.setattr(swing_up, "SwingUp", Shaken)
    study = read_study(draw_swing_up((), 1800005, tmp_path).study)
    found = diagnose_joint(study)
    assert found.log.effort_noise == 0.0
    assert found.verdict == "adequate", str(found)


def test_trials_without_an_effort_beside_others_are_no_error(tmp_path):
    """A swing that was let go stands beside trials that a controller drove: nothing is asked of its effort."""
    study = read_study(draw_swing_up((), 1800005, tmp_path).study)
    let_go = replace(study.trials[0].without("effort"), name="let go").first(400)
    found = diagnose_joint(replace(study, trials=(*study.trials, let_go)), limit=20.0)
    assert found.log.effort_noise == 0.0
