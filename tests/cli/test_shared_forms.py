"""Small inputs like real ones on whose form a newcomer failed: each is read, or what is odd is one short line."""

import numpy as np
import pytest
from cli.test_own import fails, run

from fes_pin.data.errors import InputError
from fes_pin.data.motion import read_motion
from fes_pin.data.new_recording import propose
from fes_pin.data.schema import known_rigs
from fes_pin.data.study import read_study

pytestmark = pytest.mark.shared
ROD = ("--rod", "0.3", "0.2")


def made(monkeypatch, folder, files, *words):
    """The study that `new-study` makes of files elsewhere."""
    assert run(monkeypatch, "new-study", *files, *words, "--out", folder) == 0
    return read_study(folder)


def test_a_transposed_table(monkeypatch, capsys, shared, tmp_path):
    study = made(monkeypatch, tmp_path, [shared / "cases/transposed_table/a.csv"], *ROD)
    assert "3 names, 400 columns, 3 rows: the table is taken as transposed" in capsys.readouterr().out
    assert len(study.trials[0].time) == 400 and study.trials[0].dt == pytest.approx(0.005)


def test_a_header_of_two_lines_over_one_column(monkeypatch, capsys, shared, tmp_path):
    files = sorted((shared / "cases/two_line_header_over_one_column").glob("*.txt"))
    words = ("new-study", *files, *ROD, "--column", "position=start_deg:deg", "--out", tmp_path)
    said = fails(monkeypatch, capsys, *words)
    assert "a.txt, b.txt, c.txt: line 1 has 3 names over 1 column" in said and len(said) < 300
    study = made(monkeypatch, tmp_path, files, *ROD, "--column", "position=column1:deg")
    assert all(t.dt == pytest.approx(0.01) for t in study.trials)
    assert [t["position"][0] for t in study.trials[:1]] == pytest.approx([np.radians(45.0)])


def test_two_names_over_four_columns(monkeypatch, capsys, shared, tmp_path):
    path = shared / "cases/two_names_four_columns.csv"
    said = fails(monkeypatch, capsys, "new-study", path, *ROD, "--out", tmp_path)
    assert "line 1 has 2 names over 4 columns" in said and "--names a,b,c,d says which" in said and len(said) < 400
    names = ("--names", "time_s,a,position,b", "--column", "effort=")
    study = made(monkeypatch, tmp_path, [path], *ROD, *names)
    assert study.trials[0]["position"][0] == 0.000603675


def test_a_row_of_units_and_a_rate(monkeypatch, shared, tmp_path):
    path = shared / "cases/units_row_taken_for_names/passive1.csv"
    words = ("--set", "kind=imposed", "--column", "effort=Torque:Nm")
    (trial,) = made(monkeypatch, tmp_path, [path], *ROD, *words).trials
    assert trial.dt == pytest.approx(1 / 1500) and trial["position"][0] == pytest.approx(np.radians(-20.0))
    assert propose(path, known_rigs()["joint"], True).units["EMG1"] == "V"


def test_two_loggers(monkeypatch, capsys, shared):
    motor = propose(shared / "cases/two_clocks_motor.csv", known_rigs()["joint"], False)
    assert motor.recording.names == ("Time", "Servo motor speed", "Torque") and motor.units["Time"] == "ms"
    assert motor.candidates["time_s"] == ("Time",) and motor.rate_hz == pytest.approx(1e3 / 0.667)
    force = propose(shared / "cases/two_clocks_force.csv", known_rigs()["muscle"], None)
    assert force.recording.names == ("Time", "Force") and force.units == {"Time": "s", "Force": "V"}
    assert force.candidates["force_n"] == ("Force",) and force.rate_hz == 2000.0
    said = fails(monkeypatch, capsys, "new-study", shared / "cases/two_clocks_force.csv", "--rig", "muscle")
    assert "--column force_n=Force,scale=NUMBER (N for each V" in said


def test_a_force_is_no_pulse_width_of_a_stimulation_log(shared):
    found = propose(shared / "cases/fes_amplitude_events.csv", known_rigs()["muscle"], None)
    assert found.candidates["pulse_width_us"] == ("Microseconds",)
    assert found.candidates["force_n"] == ("CurrentKG",)
    assert found.recording.columns["UnixTimestamp"][0] == 0.0 and "since 1970" in found.recording.said[0]


def test_a_motion_file_that_a_spreadsheet_saved(monkeypatch, shared, tmp_path):
    path = shared / "cases/saved_by_excel.mot"
    table, in_degrees = read_motion(path)
    assert in_degrees and len(table) == 200 and table.names == ("time", "knee_angle_r", "hip_flexion_r")
    study = made(monkeypatch, tmp_path, [path], *ROD, "--column", "position=hip_flexion_r")
    assert study.trials[0]["position"][0] == pytest.approx(np.radians(10.0))
    cut = tmp_path / "cut.mot"
    cut.write_text("\n".join(path.read_text().splitlines()[:-2]))
    assert read_motion(cut)[0].said == ("the header of cut.mot says 200 rows, and there are 198",)
    cut.write_text(path.read_text().replace("0.01,", "x,", 1))
    with pytest.raises(InputError, match="row 10"):
        read_motion(cut)
