"""What `fes-pin new-study` asks at a terminal: all that is odd once, each thing again until it is understood."""

import sys

import numpy as np
import pytest
from cli.test_own import TRIALS, fails, plain, run

from fes_pin.cli import own
from fes_pin.data.study import read_study

TIME, ANGLE, EFFORT = TRIALS[0]
ROD = ("--rod", 0.4, 1.2)


@pytest.fixture
def person(monkeypatch):
    """Somebody at a terminal: `answers` by the beginning of a question, one after the other; `asked` what was."""

    class Person:
        def __init__(self):
            self.answers, self.asked, self.said = {}, [], []

        def __call__(self, question):
            self.asked.append(question)
            key = next(key for key in self.answers if key in question)
            left = self.answers[key]
            return left.pop(0) if len(left) > 1 else left[0]

    one = Person()
    monkeypatch.setattr(own, "_ask", one)
    monkeypatch.setattr(own, "_say", one.said.append)
    for stream in (sys.stdin, sys.stdout):
        monkeypatch.setattr(stream, "isatty", lambda: True, raising=False)
    return one


def degrees(path, names=("time", "Angle")):
    path.write_text(plain((1e3 * TIME, np.degrees(ANGLE)), names))
    return path


WRONG = ["Angel:deg", "Angle:furlong", "Angle:deg,zero=x", "Angle:deg,gain=2", "deg", "Angle:deg,zero"]


@pytest.mark.parametrize("wrong", WRONG)
def test_an_answer_that_is_not_understood_is_asked_again_with_the_reason(monkeypatch, person, tmp_path, wrong):
    person.answers = {"time_s=": ["time:ms"], "position=": [wrong, wrong, "position=Angle:deg"]}
    assert run(monkeypatch, "new-study", degrees(tmp_path / "a.csv"), *ROD) == 0
    assert len(person.asked) == 4 and len(person.said) == 1
    again = person.asked[2]
    assert again.endswith(person.asked[1]) and ("expected" in again)
    assert np.allclose(read_study(tmp_path).trials[0]["position"], ANGLE, atol=1e-6)


def test_numbers_are_asked_again_too_and_of_each_trial(monkeypatch, person, tmp_path):
    frames = {"x/a.csv": 1.0, "y/a.csv": 2.0}
    for name in frames:
        (tmp_path / name).parent.mkdir()
        width = 400 + 300 * np.sign(EFFORT)
        (tmp_path / name).write_text(plain((TIME, 1.2 + 0.1 * ANGLE, width), ("time_s", "angle_rad", "pulse_width_us")))
    loads = ["-1", "heavy", "1.5", "load_kg=2.5"]
    person.answers = {
        "load_kg": loads,
        "foot_mass_kg": ["0,1", "0.1"],
        "threshold_us": ["50"],
        "saturation_us": ["600"],
    }
    person.answers["=NUMBER"] = ["0.2"]
    assert run(
        monkeypatch, "new-study", *(tmp_path / n for n in frames), "--rig", "ankle", "--out", tmp_path / "s"
    ) in (0, 2)
    wrong = [question for question in person.asked if question.startswith("expected a number")]
    assert len(wrong) == 3 and all("load_kg" in q or "foot_mass_kg" in q for q in wrong)
    assert person.said[0].count("--set a.csv:load_kg=NUMBER (kg)") == 2 and len(loads) == 1


def test_all_that_is_odd_is_said_once_before_the_first_question(monkeypatch, person, tmp_path):
    values = np.column_stack([TIME, ANGLE, EFFORT])
    for name in ("a.csv", "b.csv"):
        rows = "".join(",".join(f"{x:.5f}" for x in row) + "\n" for row in values)
        (tmp_path / name).write_text(f"Time,data\n{rows}")
    person.answers = {"time_s=": ["column1:s"], "position=": ["column2:rad"]}
    assert run(monkeypatch, "new-study", tmp_path / "a.csv", tmp_path / "b.csv", *ROD) == 0
    (said,) = person.said
    lines = said.splitlines()
    assert lines[0].startswith("a.csv, b.csv: line 1 has 2 names over 3 columns")
    assert lines[1] == "what the files do not say:" and len(lines) == 4 and len(person.asked) == 2


def test_nothing_said_to_what_is_needed_is_missing(monkeypatch, capsys, person, tmp_path):
    person.answers = {"time_s=": [""], "position=": ["Angle:deg"]}
    assert run(monkeypatch, "new-study", degrees(tmp_path / "a.csv"), *ROD) == 2
    assert "please add --column time_s=time:UNIT" in capsys.readouterr().err


def test_nothing_said_to_what_is_not_needed_takes_none(monkeypatch, person, tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(plain((TIME, ANGLE, EFFORT), ("time_s", "angle_rad", "Motor current")))
    person.answers = {"effort=": [""]}
    assert run(monkeypatch, "new-study", path, *ROD) == 0
    assert "effort" not in read_study(tmp_path).trials[0].columns


def test_nobody_is_asked_what_everything_says(monkeypatch, person, tmp_path):
    (tmp_path / "a.csv").write_text(plain((TIME, ANGLE, EFFORT), ("time_s", "angle_rad", "torque_Nm")))
    assert run(monkeypatch, "new-study", tmp_path / "a.csv", *ROD) == 0
    assert person.asked == person.said == []


def test_a_new_question_follows_from_an_answer(monkeypatch, person, tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(plain((TIME, 400 + 300 * np.sign(EFFORT), 2 + ANGLE), ("time_s", "what", "force_N")))
    person.answers = {"pulse_width_us=": ["what:us"], "threshold_us": ["50"], "saturation_us": ["900"]}
    assert run(monkeypatch, "new-study", path, "--rig", "muscle") == 0
    assert [q.split("=")[0] for q in person.asked] == ["pulse_width_us", "threshold_us", "saturation_us"]


@pytest.mark.parametrize("options", [("--names", "time_s,position"), ("--header-row", "2"), ("--first-row", "4")])
def test_options_of_the_form_are_of_text_files_with_recordings(monkeypatch, capsys, tmp_path, options):
    assert "new-study" not in fails(monkeypatch, capsys, "new-study", *ROD, *options)
    (tmp_path / "a.csv").write_text("Lab\ntime_s,position\n" + plain((TIME, ANGLE), ("s", "rad")))
    assert run(monkeypatch, "new-study", tmp_path / "a.csv", *ROD, *options) == 0
    assert np.allclose(read_study(tmp_path).trials[0]["position"][-5:], ANGLE[-5:], atol=1e-5)


def test_a_first_row_is_below_the_header(monkeypatch, capsys, tmp_path):
    path = degrees(tmp_path / "a.csv")
    words = ("new-study", path, *ROD, "--header-row", "4", "--first-row", "4")
    assert "--first-row: expected a line below the header in line 4" in fails(monkeypatch, capsys, *words)


@pytest.mark.parametrize("suffix", [".c3d", ".trc"])
def test_markers_of_a_walk_are_another_tools(monkeypatch, capsys, tmp_path, suffix):
    (tmp_path / f"walk{suffix}").write_bytes(b"PathFileType")
    said = fails(monkeypatch, capsys, "new-study", tmp_path / f"walk{suffix}", "--rig", "body")
    assert "OpenSim's inverse kinematics" in said and said.endswith("its .mot is read here")
