"""What was said wrongly, or cannot be, ends in one line that names the option or the file; found by `scripts/fuzz`."""

import json
import re
import warnings

import numpy as np
import pytest
from cli.test_own import LENGTH, MASS, TRIALS, fails, plain, run
from diagnosis.hidden import study_of

from fes_pin.data.by_itself import resting
from fes_pin.data.motion import GROUND_REACTION, REQUIRED
from fes_pin.data.study import read_study, write_study
from fes_pin.data.trial import Trial
from fes_pin.data.trial_files import write_trial
from fes_pin.models.nominal import nominal_model
from fes_pin.models.store import model_toml

ROD = ("--rod", LENGTH, MASS)
NAMES = ("time_s", "position", "effort")


@pytest.fixture
def recording(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(plain(TRIALS[0], NAMES))
    return path


@pytest.mark.parametrize("time", ["", "rate=0", "rate=-5", "rate=nan", "rate=inf", "rate=50,scale=2"])
def test_times_that_cannot_be_name_their_option(monkeypatch, capsys, recording, time):
    said = fails(monkeypatch, capsys, "new-study", recording, *ROD, "--column", f"time_s={time}")
    assert said.startswith("fes-pin: --column time_s: expected") and "rate=HZ" in said


def two_loggers(folder):
    time, angle, effort = TRIALS[0]
    for k in "ab":
        (folder / f"{k}_pos.csv").write_text(plain((time, angle), NAMES[:2]))
        (folder / f"{k}_tau.csv").write_text(plain((time, effort), ("time_s", "effort")))
    return ("new-study", *sorted(folder.glob("*.csv")), *ROD, "--source", "pos=*pos", "--source", "tau=*tau")


def test_an_offset_that_is_no_number_names_its_option(monkeypatch, capsys, tmp_path):
    said = fails(monkeypatch, capsys, *two_loggers(tmp_path), "--offset", "tau=nan")
    assert said.startswith("fes-pin: --offset tau: expected a finite number in s")


def test_a_condition_of_a_later_trial_names_a_file_of_it(monkeypatch, capsys, tmp_path):
    said = fails(monkeypatch, capsys, *two_loggers(tmp_path), "--set", "b_pos.csv:from=2", "--set", "b_pos.csv:to=1")
    assert said.startswith("fes-pin: --set b_pos.csv:")


def test_trials_of_which_all_are_held_out_are_no_study(monkeypatch, capsys, recording):
    said = fails(monkeypatch, capsys, "new-study", recording, *ROD, "--role", "a.csv=held_out")
    assert said == "fes-pin: --role: expected at least one trial to fit; all are held_out"
    assert not (recording.parent / "study.toml").exists()


def test_an_integer_beyond_every_float_is_no_rate(monkeypatch, tmp_path):
    time, angle, effort = (one.tolist() for one in TRIALS[0])
    content = {"time_s": time, "position": angle, "effort": effort, "fs": 10**400}
    (tmp_path / "a.json").write_text(json.dumps(content))
    assert run(monkeypatch, "new-study", tmp_path / "a.json", *ROD) == 0


def test_times_of_one_row_do_not_rise(monkeypatch, capsys, tmp_path):
    rows = ("Time [s],t [s],angle", "0.0,,0.1", "0.01,1.0,0.2", "0.02,,0.3", "0.03,,0.4")
    (tmp_path / "a.csv").write_text("\n".join(rows))
    assert "--column position=angle:UNIT" in fails(monkeypatch, capsys, "new-study", tmp_path / "a.csv", *ROD)


def test_a_trial_of_few_samples_rests_nowhere_in_its_first_tenth():
    time = np.arange(8) / 100
    trial = Trial("short", "motion", {"position": np.sin(time), "effort": np.cos(time)}, time)
    assert resting(trial, "effort", slice(len(trial) // 10)) is None


def walk(folder, **angles):
    """The words that make a study of a walk of which all angles are 0 but these, rad."""
    time = np.arange(50) * 0.02
    moves = np.stack([time, *(np.full(50, angles.get(n, 0.0)) for n in REQUIRED)])
    forces = np.stack([time, *(1.0 + 0 * time for _ in GROUND_REACTION)])
    (folder / "grf.csv").write_text(plain(forces, ("time_s", *GROUND_REACTION)))
    (folder / "ik.csv").write_text(plain(moves, ("time_s", *(f"q_{n}" for n in REQUIRED))))
    return ("new-study", *sorted(folder.glob("*.csv")), "--rig", "body")


def test_a_walk_that_no_joint_makes_names_the_file_of_its_coordinates(monkeypatch, capsys, tmp_path):
    words = walk(tmp_path, hip_flexion_r=50.0)
    given = [word for one in ("mass_kg=70", "height_m=1.8", "angle_unit=rad") for word in ("--set", one)]
    said = fails(monkeypatch, capsys, *words, *given)
    assert said.startswith(f"fes-pin: {tmp_path / 'ik.csv'}, q_hip_flexion_r: reaches 50; no joint turns so far")


def test_a_model_that_is_unstable_is_named(monkeypatch, capsys, tmp_path, recording):
    assert run(monkeypatch, "new-study", recording, *ROD) == 0
    study = read_study(tmp_path)
    model = tmp_path / "model.toml"
    model.write_text(
        re.sub(r"^inertia_scale = .*", "inertia_scale = 1e-300", model_toml(nominal_model(study)), flags=re.M)
    )
    write_trial(study.trials[0], tmp_path / "trial.csv")
    capsys.readouterr()
    said = fails(monkeypatch, capsys, "predict", model, tmp_path / "trial.csv", "--out", tmp_path / "p.csv")
    assert said.startswith(f"fes-pin: {model}: the prediction of position is not finite")


def test_a_model_whose_inertia_no_body_has_is_one_line(monkeypatch, capsys, tmp_path, recording):
    assert run(monkeypatch, "new-study", recording, *ROD) == 0
    model = tmp_path / "model.toml"
    model.write_text(
        re.sub(r"^inertia = .*", "inertia = -1", model_toml(nominal_model(read_study(tmp_path))), flags=re.M)
    )
    capsys.readouterr()
    said = fails(monkeypatch, capsys, "predict", model, tmp_path / "a.csv", "--out", tmp_path / "p.csv")
    assert said.startswith(f"fes-pin: {model}, row") and "constants.inertia: expected a number above 0" in said


def test_a_line_of_code_that_overflows_is_not_printed(monkeypatch, tmp_path):
    def overflowing(*given):
        warnings.warn("overflow encountered in square", RuntimeWarning, stacklevel=1)
        return "<robot/>"

    monkeypatch.setattr("fes_pin.data.templates.rod", overflowing)
    with warnings.catch_warnings(record=True) as printed:
        warnings.resetwarnings()
        assert run(monkeypatch, "new-study", *ROD, "--out", tmp_path / "rod") == 0
    assert printed == []
    with pytest.raises(RuntimeWarning):  # filters that are set come first
        run(monkeypatch, "new-study", *ROD, "--out", tmp_path / "again")


def test_a_body_that_nobody_has_names_its_study(monkeypatch, capsys, tmp_path):
    words = walk(tmp_path)
    assert run(monkeypatch, *words, "--set", "mass_kg=10", "--set", "height_m=1.8") == 0
    capsys.readouterr()
    assert fails(monkeypatch, capsys, "check", tmp_path).startswith(f"fes-pin: {tmp_path}, mass_kg: must lie between")


@pytest.mark.parametrize("offset", ["tau=fit", "tau=0.001"])
@pytest.mark.parametrize("logger", ["pos", "tau"])
def test_a_clock_that_stands_is_between_no_two_rows_of_another(monkeypatch, capsys, tmp_path, logger, offset):
    words, path = two_loggers(tmp_path), tmp_path / f"a_{logger}.csv"
    first, *rows = path.read_text().splitlines()
    path.write_text(
        "\n".join([first, *(f"{rows[100 + k % 2].split(',')[0]},{r.split(',')[1]}" for k, r in enumerate(rows))])
    )
    assert "expected time to increase" in fails(monkeypatch, capsys, *words, "--split", "none", "--offset", offset)


def test_a_condition_of_a_study_that_no_joint_has_names_the_study(monkeypatch, capsys, tmp_path):
    write_study(study_of("ankle", n_motion=1, n_isometric=1, duration_s=1.0), tmp_path)
    text = (tmp_path / "study.toml").read_text()
    (tmp_path / "study.toml").write_text(re.sub(r"angle_rad = [\d.]+", "angle_rad = 1e20", text))
    assert fails(monkeypatch, capsys, "check", tmp_path).startswith(f"fes-pin: {tmp_path}, angle_rad: reaches 1e+20")


def test_a_quote_that_does_not_end_is_read_as_it_is(monkeypatch, capsys, tmp_path):
    (tmp_path / "a.csv").write_text('time_s,"' + "x" * 200_000 + "\n0,1\n1,2\n2,3\n")
    assert 'position="xxx' in fails(monkeypatch, capsys, "new-study", tmp_path / "a.csv", *ROD)
