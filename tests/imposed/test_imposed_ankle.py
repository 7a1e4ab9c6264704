"""An ankle on a dynamometer: the torque that it exerts, which way that counts, and what hides in it."""

import sys
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from imposed_rigs import ankle
from imposed_rigs.motion import drawn
from models.cases import foot
from scipy.integrate import solve_ivp

from fes_pin.cli import main
from fes_pin.data.study import read_study, write_study
from fes_pin.data.trial import Trial
from fes_pin.data.trial_files import read_trial, write_trial
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.models.effects import CoulombFriction
from fes_pin.models.model import Model
from fes_pin.models.nominal import nominal_model
from fes_pin.models.predict import predict
from fes_pin.models.rigs import Ankle
from fes_pin.models.simulate import simulated_trial
from fes_pin.models.store import load_model, save_model
from fes_pin.prepare.measured import check_study

RIG = Ankle(0.65, 0.05, 1.4e-3, 0.06, constants=ankle.KNOWN)


def moved(width=0.0, dt=2e-3, n=1500):
    motion, time = drawn(1.75, 0.3, 0.3, 1.2, np.random.default_rng(4)), np.arange(n) * dt
    columns = {"pulse_width_us": np.where((time > 0.5) & (time < 1.6), width, 0.0), "angle_rad": motion.at(time)}
    return motion, Trial("moved", "imposed", columns, time)


def run(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["fes-pin", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main.main()
    return ended.value.code or 0


def made(tmp_path, *causes, seed, size=0.3):
    return ankle.study(causes, size, np.random.default_rng(seed), tmp_path / "made")


def test_unstimulated_the_torque_is_that_of_inverse_dynamics():
    """Of Pinocchio's RNEA on the motion itself, with the antagonist and damping of eq. (1) taken off."""
    motion, trial = moved()
    q, v, a = (motion.at(trial.time, k) for k in range(3))
    body = foot(ankle.KNOWN["foot_mass_kg"], ankle.KNOWN["com_distance_m"], RIG.inertia_kgm2)
    data = body.createData()
    needed = np.array([pin.rnea(body, data, *(np.array([x[k]]) for x in (q, v, a)))[0] for k in range(len(q))])
    antagonist = ankle.KNOWN["f0_n"] * np.expm1(ankle.KNOWN["f1_per_rad"] * (q - ankle.KNOWN["theta_r_rad"]))
    wanted = -needed - RIG.damping_nms * v - ankle.KNOWN["com_distance_m"] * antagonist * np.sin(q)
    missed = simulated_trial(Model(RIG), trial)["torque_nm"] - wanted
    assert np.abs(missed).max() < 1e-3 * np.ptp(wanted)


def test_stimulated_the_muscle_pulls_with_its_lever():
    motion, trial = moved(700.0)
    r = (trial["pulse_width_us"] - 180.0) / 820.0

    def rate(t, act):
        return (max(float(r[min(int(t / trial.dt + 1e-9), len(r) - 1)]), 0.0) - act) / RIG.time_constant_s

    act = solve_ivp(rate, (0.0, trial.time[-1]), [0.0], "RK45", trial.time, max_step=trial.dt, rtol=1e-8).y[0]
    pull = simulated_trial(Model(RIG), trial)["torque_nm"] - simulated_trial(Model(RIG), moved()[1])["torque_nm"]
    wanted = RIG.gain * 56.0 * 0.034 * act * np.sin(motion.at(trial.time))
    assert np.abs(pull - wanted).max() < 0.02 * wanted.max()


def test_friction_follows_the_velocity():
    motion, trial = moved()
    v, plain = motion.at(trial.time, 1), simulated_trial(Model(RIG), trial)["torque_nm"]
    rubbed = simulated_trial(Model(RIG) + CoulombFriction(torque_nm=0.1), trial)["torque_nm"]
    fast = np.abs(v) > 0.1
    assert np.abs(plain - rubbed - 0.1 * np.sign(v))[fast].max() < 1e-3


def test_a_muscle_pulls_whichever_way_the_dynamometer_counts(tmp_path):
    one = made(tmp_path, seed=2)
    other = replace(one, trials=tuple(t.with_columns(torque_nm=-t["torque_nm"]) for t in one.trials))
    signs = [nominal_model(s).rig.constants.get("torque_sign", 1.0) for s in (one, other)]
    assert sorted(signs) == [-1.0, 1.0]
    answers = [simulated_trial(nominal_model(s), one.trials[1])["torque_nm"] for s in (one, other)]
    assert np.array_equal(answers[0], -answers[1])
    told = [any("the opposite sign" in w for w in check_study(s, nominal_model(s))) for s in (one, other)]
    assert told == [s < 0.0 for s in signs]


@pytest.mark.parametrize("seed", range(2))
def test_an_angle_that_counts_from_the_foot_at_right_angles_is_said(tmp_path, seed):
    """So dynamometers count: plantar flexion or dorsiflexion from 0; the model's muscle would push below 0."""
    usual = made(tmp_path, seed=seed)
    for turned in (lambda q: q - 0.5 * np.pi, lambda q: 0.5 * np.pi - q, lambda q: q + 0.5 * np.pi):
        trials = tuple(t.with_columns(angle_rad=turned(t["angle_rad"])) for t in usual.trials)
        (said,) = [
            w for w in check_study(replace(usual, trials=trials), nominal_model(usual)) if "an ankle's counts" in w
        ]
        assert "zero = -90" in said and "\n" not in said
    assert not [w for w in check_study(usual, nominal_model(usual)) if "an ankle's counts" in w]


@pytest.mark.parametrize("cause", ["force_velocity", "passive_relaxation"])
def test_a_hidden_cause_is_named_and_predicted(tmp_path, cause):
    """Through files: study, diagnosis, model, and a trial from its inputs alone."""
    write_study(made(tmp_path, cause, seed=7), tmp_path / "study")
    study = read_study(tmp_path / "study")
    found = diagnose_joint(study)
    assert cause in (found.causes[0].name, *found.causes[0].equivalents)
    assert found.extended_error[1] < 0.2 * found.nominal_error[1]
    save_model(found.model, tmp_path / "model.toml")
    write_trial(study.trials[1].without("torque_nm"), tmp_path / "one.csv")
    again = read_trial(tmp_path / "one.csv", rig="ankle", kind="imposed", inputs_only=True)
    predicted = predict(load_model(tmp_path / "model.toml"), again)["torque_nm"]
    assert np.abs(predicted - simulated_trial(found.model, study.trials[1])["torque_nm"]).max() < 1e-9


@pytest.mark.parametrize("seed", [7, 8])
def test_nothing_hidden_is_adequate(tmp_path, seed):
    assert diagnose_joint(made(tmp_path, seed=seed)).verdict == "adequate"


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda t: {"angle_rad": np.full(len(t), 1.7)}, "never moves"),
        (lambda t: {"angle_rad": np.degrees(t["angle_rad"])}, "is it in degrees?"),
        (lambda t: {"torque_nm": np.zeros(len(t))}, "no output changes"),
    ],
)
def test_what_cannot_be_is_one_line_and_nothing_written(tmp_path, monkeypatch, capsys, spoil, words):
    good = made(tmp_path, seed=1)
    write_study(good, tmp_path / "study")
    for trial in good.trials:
        write_trial(
            trial.with_columns(**spoil(trial)), tmp_path / "study" / "trials" / f"{trial.name}.csv", overwrite=True
        )
    for command in (["diagnose", tmp_path / "study", "--out", tmp_path / "answer"], ["check", tmp_path / "study"]):
        assert run(monkeypatch, *command) == 2
        told = capsys.readouterr().err.strip()
        assert "\n" not in told and words in told
    assert not (tmp_path / "answer").exists()


def test_a_recording_with_a_torque_and_an_angle_is_of_an_imposed_motion(tmp_path, monkeypatch):
    trial = made(tmp_path, seed=1).trials[1]
    rows = np.stack([trial.time, trial["pulse_width_us"], np.degrees(trial["angle_rad"]), 1e3 * trial["torque_nm"]])
    path = tmp_path / "new" / "a.csv"
    path.parent.mkdir()
    np.savetxt(path, rows.T, delimiter=",", header="time_s,pulse_width_us,Angle [deg],Torque [mNm]", comments="")
    numbers = [w for k, v in ankle.KNOWN.items() for w in ("--set", f"{k}={v}")]
    assert run(monkeypatch, "new-study", path, "--rig", "ankle", *numbers) == 0
    (again,) = read_study(path.parent).trials
    assert again.kind == "imposed"
    assert np.allclose(again["angle_rad"], trial["angle_rad"]) and np.allclose(again["torque_nm"], trial["torque_nm"])
