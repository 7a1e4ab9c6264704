"""Recordings that are not one trial a file, in the forms of public ones: `cases` of the measured data."""

import re

import numpy as np
import pytest
from cli.test_own import run

import fes_pin as fp

pytestmark = pytest.mark.shared


def study_of(monkeypatch, capsys, folder, files, *words):
    """The study that one command makes, and what it printed."""
    assert run(monkeypatch, "new-study", *files, *words, "--out", folder) == 0
    return fp.read_study(folder), " ".join(capsys.readouterr().out.split())


def test_two_recordings_in_one_file(shared, monkeypatch, capsys, tmp_path):
    file = shared / "cases/two_recordings_in_one.csv"
    study, printed = study_of(monkeypatch, capsys, tmp_path / "a", [file], "--pendulum", "0.3", "1")
    assert "2 recordings in one file: time starts again in row 202" in printed
    assert [len(t) for t in study] == [200, 200]


def test_a_hole_is_said_and_cut_or_bridged(shared, monkeypatch, capsys, tmp_path):
    file = shared / "cases/gap_10ms_at_1kHz.csv"
    study, printed = study_of(monkeypatch, capsys, tmp_path / "a", [file], "--rod", "0.3", "1")
    assert "1 hole, the longest 10 ms: 2 trials" in printed
    assert len(study) == 2
    words = ("--rod", "0.3", "1", "--resample", "200")
    study, printed = study_of(monkeypatch, capsys, tmp_path / "b", [file], *words)
    assert "holes in time are bridged: 1, the longest 10 ms" in printed
    assert len(study) == 1


def test_an_angle_that_returns_at_360_degrees(shared, monkeypatch, capsys, tmp_path):
    file = shared / "cases/angle_wraps.csv"
    words = ("--wheel", "0.01", "--column", "velocity=feedback_deg_s:deg/s")
    study, printed = study_of(monkeypatch, capsys, tmp_path / "a", [file], *words)
    assert "position jumps by 360 deg at 3 samples: unwrapped" in printed
    assert np.ptp(study.trials[0]["position"]) > 3 * 2 * np.pi


def test_two_loggers_of_one_trial(shared, monkeypatch, capsys, tmp_path):
    files = [shared / f"cases/two_clocks_{which}.csv" for which in ("motor", "force")]
    columns = ("velocity=motor.Servo motor speed,scale=0.0001", "effort=force.Force,scale=200")
    words = [word for one in columns for word in ("--column", one)]
    study, printed = study_of(monkeypatch, capsys, tmp_path / "a", files, "--slide", "20", *words)
    assert "two_clocks_motor.csv and two_clocks_force.csv are one trial" in printed
    added = re.search(r"(\S+) ms are added to the times of force: fitted", printed)
    assert added and float(added[1]) == pytest.approx(-4.0, abs=0.1)
    assert set(study.trials[0].columns) == {"position", "effort"}


def test_one_quantity_a_file(shared, monkeypatch, capsys, tmp_path):
    files = [shared / f"cases/cin_{which}1.t" for which in ("pos", "tau")]
    columns = ("time_s=column1:s", "position=pos.column2:rad", "effort=tau.column2:Nm")
    words = [word for one in columns for word in ("--column", one)]
    study, printed = study_of(monkeypatch, capsys, tmp_path / "a", files, "--rod", "0.3", "1", *words)
    assert "cin_pos1.t and cin_tau1.t are one trial" in printed
    assert len(study.trials[0]) == 300


def test_interpolated_times_blame_no_log(shared, monkeypatch, capsys, tmp_path):
    words = ("--urdf", shared / "cases/jittered_times/rotor.urdf", "--resample", "100")
    files = [shared / "cases/jittered_times/r0.csv"]
    study, _ = study_of(monkeypatch, capsys, tmp_path / "a", files, *words)
    found = fp.diagnose(study)
    assert {c.name for c in found.causes} == {"coulomb_friction"}
    assert abs(found.extended.values["coulomb_friction.torque_nm"] - 0.022) < 0.006
    assert not any("effort was recorded" in w for w in found.warnings), found.warnings
