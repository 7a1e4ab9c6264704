"""Spikes and columns that only some trials have: the diagnosis is that of the sound study."""

import json
from dataclasses import replace

import numpy as np
import pytest
from diagnosis.hidden import named, slide, study_of

from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.view.report import report

NOISE = {"angle_rad": 2e-3, "force_n": 0.2, "position": 2e-3}


def spiked(study, seed, share=0.01):
    """One sample in a hundred off by 10 to 60 deviations of the noise; and how many there are."""
    rng, trials, count = np.random.default_rng(seed), [], 0
    for trial in study.trials:
        columns = {}
        for name, std in NOISE.items():
            if name in trial:
                hit = rng.random(len(trial)) < share
                size = rng.uniform(10.0, 60.0, len(trial)) * rng.choice([-1.0, 1.0], len(trial))
                columns[name], count = trial[name] + np.where(hit, size * std, 0.0), count + int(hit.sum())
        trials.append(trial.with_columns(**columns))
    return replace(study, trials=tuple(trials)), count


@pytest.mark.parametrize(
    ("rig", "names", "seed"),
    [
        ("ankle", ("coulomb_friction",), 0),
        ("ankle", (), 1),
        ("joint", ("coulomb_friction",), 2),
        ("muscle", ("fatigue",), 3),
    ],
)
def test_spikes_change_no_verdict(rig, names, seed, tmp_path):
    study = study_of(rig, names, "white", seed)
    bad, count = spiked(study, seed)
    sound, diagnosis = diagnose_joint(study), diagnose_joint(bad)
    assert sound.left_out == {} and "left_out_samples" not in sound.record()
    assert named(diagnosis) == named(sound) == [{n} for n in names], str(diagnosis)
    assert diagnosis.verdict == sound.verdict
    for name, noise in sound.extended.noise.items():
        assert diagnosis.extended.noise[name].std == pytest.approx(noise.std, rel=0.1)
    for name in sound.extended.free:
        assert abs(diagnosis.extended.values[name] - sound.extended.values[name]) < 1.5 * sound.extended.std(name)
        assert diagnosis.extended.std(name) == pytest.approx(sound.extended.std(name), rel=0.25)
    record = json.loads(json.dumps(diagnosis.record()))
    told = sum(n for columns in record["left_out_samples"].values() for n in columns.values())
    assert 0.85 * count <= told <= count + 3
    assert "left out as spikes" in str(diagnosis)
    report(diagnosis, tmp_path / "report.html")
    assert "Left out as spikes" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize("driven", [True, False])
@pytest.mark.parametrize("without", [(0, 2), (1, 3, 4)])
def test_a_velocity_that_some_trials_lack(driven, without, tmp_path):
    whole = slide(0, {"coulomb_friction": {"torque_nm": 0.15}}, driven)
    trials = tuple(t.without("velocity") if k in without else t for k, t in enumerate(whole.trials))
    diagnosis = diagnose_joint(replace(whole, trials=trials))
    assert [s for s in named(diagnosis) if "coulomb_friction" in s], str(diagnosis)
    assert set(diagnosis.extended.noise) == {"position", "velocity"}
    assert diagnosis.extended.noise["velocity"].std == pytest.approx(1e-2, rel=0.3)
    for cause in diagnosis.causes:
        if cause.name == "coulomb_friction":
            assert abs(cause.parameters["torque_nm"].value - 0.15) < 5.0 * cause.parameters["torque_nm"].std
    report(diagnosis, tmp_path / "report.html")


def test_trials_with_and_without_an_effort():
    pushed, free = slide(3, {}, True), slide(3, {}, False)
    mixed = tuple(replace(t, name=f"free {t.name}") for t in free.trials[:2]) + pushed.trials[2:]
    diagnosis = diagnose_joint(replace(pushed, trials=mixed))
    assert diagnosis.verdict == "adequate", str(diagnosis)
