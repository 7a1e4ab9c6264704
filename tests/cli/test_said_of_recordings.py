"""What is said of recordings in `fes-pin new-study`: units, roles, groups; nothing that is said is lost in silence."""

import shlex
import tomllib

import numpy as np
import pytest
from cli.test_own import LENGTH, MASS, TRIALS, fails, plain, recordings, run  # noqa: F401

from fes_pin.data.errors import InputError
from fes_pin.data.study import read_study

TIME, ANGLE, EFFORT = TRIALS[0]
ROD = ("--rod", LENGTH, MASS)


def swing(path, header="position"):
    """A recording in degrees, whose header says so or not."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(plain((TIME, np.degrees(ANGLE), EFFORT), ("time_s", header, "effort")))
    return path


@pytest.mark.parametrize("more", ["", ",scale=1", ",zero=0"])
def test_a_unit_in_a_header_holds_where_the_column_is_named_by_hand(monkeypatch, tmp_path, more):
    path = swing(tmp_path / "a.csv", "Angle [deg]")
    assert run(monkeypatch, "new-study", path, *ROD, "--column", f"position=Angle [deg]{more}") == 0
    assert np.allclose(read_study(tmp_path).trials[0]["position"], ANGLE, atol=1e-6)


def test_a_scale_beside_a_unit_in_a_header_must_say_which_it_is_of(monkeypatch, capsys, tmp_path):
    path = swing(tmp_path / "a.csv", "Angle [deg]")
    words = ("new-study", path, *ROD, "--column", "position=Angle [deg],scale=0.0174533")
    assert "--column position: a scale, and the file says deg" in fails(monkeypatch, capsys, *words)


def test_a_study_by_hand_must_say_the_unit_that_a_header_states(monkeypatch, tmp_path):
    assert run(monkeypatch, "new-study", swing(tmp_path / "a.csv", "Angle [deg]"), *ROD) == 0
    place = tmp_path / "study.toml"
    text = place.read_text()
    assert ', unit = "deg"' in text
    place.write_text(text.replace(', unit = "deg"', ""))
    with pytest.raises(InputError, match="the name says deg"):
        read_study(tmp_path)


def test_a_name_of_two_files_is_refused_and_a_path_tells_them_apart(monkeypatch, capsys, tmp_path):
    x, y = (swing(tmp_path / "rec" / folder / "a.csv", "Angle_deg") for folder in "xy")
    words = ["new-study", x, y, *ROD]
    said = fails(monkeypatch, capsys, *words, "--set", "a.csv:start_s=60")
    assert said.startswith("fes-pin: --set a.csv:start_s: names several files: expected ") and str(y) in said
    said = fails(monkeypatch, capsys, *words, "--set", "x/a.csv:start_s=60", "--set", "x/a:start_s=70")
    assert "said twice of a.csv" in said
    assert run(monkeypatch, *words, "--set", "x/a.csv:start_s=60", "--set", "y/a:start_s=70") == 0
    assert [t.conditions["start_s"] for t in read_study(tmp_path / "rec").trials] == [60.0, 70.0]


def test_roles_and_groups_are_said_of_files_and_patterns(monkeypatch, capsys, recordings):  # noqa: F811
    words = ["new-study", *sorted(recordings.glob("*.csv")), *ROD, "--role", "m3.csv=held_out"]
    assert "--role: expected one of fit, held_out" in fails(monkeypatch, capsys, *words, "--role", "m0=test")
    assert "said twice of m1.csv" in fails(monkeypatch, capsys, *words, "--group", "m*=all", "--group", "m1=one")
    assert "expected one of the files" in fails(monkeypatch, capsys, *words, "--group", "n*=all")
    assert run(monkeypatch, *words, "--group", "m[01]*=before", "--group", "m2=after it") == 0
    trials = read_study(recordings).trials
    assert [t.role for t in trials] == [None, None, None, "held_out"]
    assert [t.group for t in trials] == ["before", "before", "after it", None]


UNREAD = {  # options, the option that nothing would read
    "condition_of_another_kind": (("--set", "angle_rad=1.9"), "--set angle_rad"),
    "condition_of_another_file": (("--set", "a.csv:angle_rad=1.9"), "--set angle_rad"),
    "column_of_another_kind": (("--column", "torque_nm=u"), "--column torque_nm"),
    "rate_of_nothing": (("--resample", "0"), "--resample"),
    "underscores": (("--set", "foot_mass_kg=1_0"), "--set foot_mass_kg"),
    "saturation_below_threshold": (("--set", "saturation_us=100"), "--set saturation_us"),
}


@pytest.mark.parametrize("case", UNREAD)
def test_what_nothing_reads_is_refused_by_the_option_that_said_it(monkeypatch, capsys, tmp_path, case):
    """Also what only the study.toml would show that is not written yet."""
    more, option = UNREAD[case]
    path = tmp_path / "a.csv"
    path.write_text(plain((TIME, 400 + 0 * TIME, ANGLE, EFFORT), ("time_s", "pulse_width_us", "angle_rad", "u")))
    known = {"foot_mass_kg": 0.1, "com_distance_m": 0.08, "moment_arm_m": 0.04, "force_scale_n": 56}
    known |= {
        "threshold_us": 180,
        "saturation_us": 1000,
        "f0_n": 4,
        "f1_per_rad": 2.2,
        "theta_r_rad": 1.3,
        "load_kg": 1,
    }
    given = [f"--set={name}={value}" for name, value in known.items() if f"{name}=" not in more[1]]
    said = fails(monkeypatch, capsys, "new-study", path, "--rig", "ankle", *given, *more)
    assert said.startswith(f"fes-pin: {option}: ") and "study.toml" not in said
    assert list(tmp_path.iterdir()) == [path]


def test_a_kind_and_a_library_of_walking_are_refused(monkeypatch, capsys, tmp_path):
    path = swing(tmp_path / "a.csv")
    words = ("new-study", path, "--rig", "body")
    assert "--rig: expected no URDF" in fails(monkeypatch, capsys, *words, "--fill")
    (tmp_path / "causes.py").write_text(CAUSE)
    assert "--library for walking" in fails(monkeypatch, capsys, *words, "--library", tmp_path / "causes.py")


CAUSE = '''"""A cause."""
from dataclasses import dataclass

from fes_pin.models.effects.coulomb_friction import CoulombFriction


@dataclass(frozen=True)
class OwnFriction(CoulombFriction):
    """Dry friction, again.

        tau = -torque tanh(v / v0)

    Tell-tale: as dry friction.
    """

    name = "own_friction"
'''


def test_next_steps_can_be_pasted_where_a_folder_has_spaces(monkeypatch, capsys, tmp_path):
    folder = tmp_path / "my recordings"
    path = swing(folder / "a.csv", "Angle_deg")
    assert run(monkeypatch, "new-study", path, *ROD) == 0
    steps = [shlex.split(line) for line in capsys.readouterr().out.splitlines() if line.startswith("  fes-pin")]
    assert [step[2] for step in steps] == [str(folder)] * 2
    assert tomllib.loads((folder / "study.toml").read_text())["study"]["name"] == "my recordings"
