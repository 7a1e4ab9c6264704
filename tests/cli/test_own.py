"""`fes-pin new-study` and `check`: from recordings as they were written to a study, and what is odd."""

import re
import sys
import tomllib

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fes_pin.cli import main, own
from fes_pin.data.motion import GROUND_REACTION, REQUIRED
from fes_pin.data.schema import known_rigs
from fes_pin.data.study import read_study

LENGTH, MASS, DAMPING, FRICTION = 0.4, 1.2, 0.05, 0.1
"""A rod that turns about its end."""


def run(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["fes-pin", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main.main()
    return ended.value.code or 0


def fails(monkeypatch, capsys, *words):
    assert run(monkeypatch, *words) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    return printed.err.strip()


def swing(number, seconds=4.0, step=0.005):
    """Angle and effort of one trial, rad and N m."""
    inertia, weight = MASS * LENGTH**2 / 3, MASS * 9.81 * LENGTH / 2
    time = np.arange(round(seconds / step)) * step
    effort = (0.4 + 0.2 * number) * np.sin(2 * np.pi * (0.4 + 0.2 * number) * time)

    def rates(t, x):
        u = effort[min(int(t / step + 1e-6), len(time) - 1)]
        return [x[1], (u - weight * np.sin(x[0]) - DAMPING * x[1] - FRICTION * np.tanh(50 * x[1])) / inertia]

    run = solve_ivp(rates, (0.0, seconds), [0.5 - 0.3 * number, 0.0], t_eval=time, max_step=step)
    return time, run.y[0] + 1e-3 * np.random.default_rng(number).standard_normal(len(time)), effort


TRIALS = [swing(k) for k in range(4)]


def german(number, reverse=1.0, shift=0):
    time, angle, effort = TRIALS[number]
    angle = angle[np.maximum(np.arange(len(time)) - shift, 0)]
    rows = [
        f"{1e3 * t:.1f};{np.degrees(q):.3f};{reverse * u:.4f};21.5".replace(".", ",")
        for t, q, u in zip(time, angle, effort, strict=True)
    ]
    return "\r\n".join([f"Messung {number}", "t_ms;Winkel [°];Drehmoment_Nm;Temp_C", *rows]) + "\r\n"


@pytest.fixture
def recordings(tmp_path):
    folder = tmp_path / "recorded"
    folder.mkdir()
    for k in range(len(TRIALS)):
        (folder / f"m{k}.csv").write_bytes(german(k).encode("cp1252"))
    return folder


def test_one_command_makes_a_study_of_german_exports(monkeypatch, capsys, recordings):
    before = {p.name: p.read_bytes() for p in recordings.iterdir()}
    assert run(monkeypatch, "new-study", *sorted(recordings.glob("*.csv")), "--rod", LENGTH, MASS) == 0
    said = capsys.readouterr().out
    assert "nothing is odd about its numbers" in said and 'kind is left out and "motion" is taken' in said
    assert {p.name: p.read_bytes() for p in recordings.iterdir() if p.name in before} == before
    study = read_study(recordings)
    assert [t.name for t in study.trials] == ["m0", "m1", "m2", "m3"]
    assert np.allclose(study.trials[2]["position"], TRIALS[2][1], atol=1e-5)
    assert np.allclose(study.trials[2]["effort"], TRIALS[2][2], atol=1e-4)
    assert tomllib.loads((recordings / "study.toml").read_text())["columns"]["ignored"] == ["Temp_C"]
    assert run(monkeypatch, "check", recordings) == 0
    said = capsys.readouterr().out
    assert "nothing is odd" in said and "shifted" not in said and "opposite sign" not in said
    shown = next(line for line in said.splitlines() if line.startswith("these trials can show"))
    assert "coulomb_friction" in shown
    assert fails(monkeypatch, capsys, "new-study", recordings / "m0.csv", "--rod", 1, 1).endswith("writes over it")


def test_a_trial_shifted_in_time_and_an_effort_turned_round_are_said(monkeypatch, capsys, recordings):
    (recordings / "m3.csv").write_bytes(german(3, shift=60).encode("cp1252"))
    assert run(monkeypatch, "new-study", *sorted(recordings.glob("*.csv")), "--rod", LENGTH, MASS) == 0
    assert run(monkeypatch, "check", recordings) == 0
    said = re.search(r"trial m3 answers (\S+) s later than the others: is it shifted", capsys.readouterr().out)
    assert said and float(said[1]) == pytest.approx(0.3, abs=0.02)
    for k in range(4):
        (recordings / f"m{k}.csv").write_bytes(german(k, reverse=-1.0).encode("cp1252"))
    assert run(monkeypatch, "check", recordings) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "effort or position has the other sign" in printed


def test_elsewhere_it_copies_recordings_and_urdf(monkeypatch, capsys, recordings, tmp_path):
    assert run(monkeypatch, "new-study", "--pendulum", 0.3, 0.5, "--upright", "--out", tmp_path / "rigs") == 0
    urdf, out = tmp_path / "rigs" / "pendulum.urdf", tmp_path / "study"
    words = ["new-study", recordings / "m0.csv", recordings / "m1.csv", "--urdf", urdf, "--out", out, "--name", "a b"]
    more = ["--column", "effort=Drehmoment_Nm:N m,scale=-1", "--set", "rig.damping=0.2", "--set", "m1:start_s=60"]
    assert run(monkeypatch, *words, *more) == 0
    study = read_study(out)
    assert study.name == "a b" and study.constants == {"damping": 0.2}
    assert set(study.start) == {"inertia_scale", "gravity_scale"}
    assert [t.conditions for t in study.trials] == [{}, {"start_s": 60.0}]
    assert np.allclose(study.trials[0]["effort"], -TRIALS[0][2], atol=1e-4)
    assert (out / "trials" / "m0.csv").read_bytes() == (recordings / "m0.csv").read_bytes()
    assert (out / "pendulum.urdf").read_bytes() == urdf.read_bytes()


def plain(columns, names):
    rows = zip(*columns, strict=True)
    return "\n".join([",".join(names), *(",".join(f"{x:.6f}" for x in row) for row in rows)]) + "\n"


def test_all_that_is_missing_is_said_at_once(monkeypatch, capsys, tmp_path):
    time, angle, effort = TRIALS[0]
    path = tmp_path / "a.csv"
    path.write_text(plain((time, angle, 0 * time, 400 + 300 * np.sign(effort)), ("time", "Angle", "Angle2", "width")))
    said = fails(monkeypatch, capsys, "new-study", path, "--rig", "ankle", "--set", "foot_mass_kg=0.1")
    assert "--column time_s=time:UNIT (0 to 3.995: s, or which unit?)" in said
    assert "--column angle_rad=Angle:UNIT" in said and "--set moment_arm_m=NUMBER (m)" in said
    assert "--set load_kg=NUMBER (kg)" in said and "foot_mass_kg" not in said
    assert list(tmp_path.iterdir()) == [path]


def test_a_unit_gives_a_column_away_where_no_word_does(monkeypatch, tmp_path):
    time, angle, effort = TRIALS[0]
    rows = "".join(
        f"{1e3 * t:.0f};{np.degrees(q):.2f};{u:.3f};ok\n".replace(".", ",")
        for t, q, u in zip(time, angle, effort, strict=True)
    )
    head = "LabDAQ 7;;;\n\nZeit;Kniegelenk;Drehmoment;Status\n[ms];[°];[Nm];\n"
    (tmp_path / "a.csv").write_bytes((head + rows).encode("cp1252"))
    assert run(monkeypatch, "new-study", tmp_path / "a.csv", "--rod", 0.4, 1.2) == 0
    (trial,) = read_study(tmp_path).trials
    assert np.allclose(trial["position"], angle, atol=1e-4) and np.allclose(trial["effort"], effort, atol=1e-3)


def test_kinds_are_told_by_what_they_read(monkeypatch, capsys, tmp_path):
    time, angle, effort = TRIALS[0]
    pulses, force = (np.arange(len(time)) % 40 == 5).astype(float), 5.0 + angle
    muscle = tmp_path / "muscle" / "a.csv"
    muscle.parent.mkdir()
    muscle.write_text(plain((time, pulses, 30.0 + angle, force), ("time_s", "stim", "length_mm", "force_N")))
    start = ("--set", "gain=10", "--set", "time_constant_s=0.05")
    assert run(monkeypatch, "new-study", muscle, "--rig", "muscle", *start) == 0
    (trial,) = read_study(muscle.parent).trials
    if "imposed" in known_rigs()["muscle"].outputs:
        assert trial.kind == "imposed" and np.allclose(trial["length_m"], 0.03 + 1e-3 * angle, atol=1e-8)
    else:
        assert trial.kind == "isometric" and 'ignored = ["length_mm"]' in (muscle.parent / "study.toml").read_text()
    joint = tmp_path / "joint" / "a.csv"
    joint.parent.mkdir()
    joint.write_text(plain((time, angle, effort), ("time_s", "angle_rad", "torque_Nm")))
    capsys.readouterr()
    assert run(monkeypatch, "new-study", joint, "--rod", 0.4, 1.2) == 0
    assert 'kind is left out and "motion" is taken' in capsys.readouterr().out
    assert run(monkeypatch, "new-study", joint, "--rod", 0.4, 1.2, "--set", "kind=imposed", "--force") == 0
    assert read_study(joint.parent).trials[0].kind == "imposed"


def test_walking_pairs_coordinates_and_ground_reaction(monkeypatch, capsys, tmp_path):
    time = np.arange(50) * 0.02
    angles = np.stack([time, *(0.01 * k + 0 * time for k in range(len(REQUIRED)))])
    forces = np.stack([time, *(1.0 * k + 0 * time for k in range(len(GROUND_REACTION)))])
    (tmp_path / "w_grf.csv").write_text(plain(forces, ("time_s", *GROUND_REACTION)))
    (tmp_path / "w_ik.csv").write_text(plain(angles, ("time_s", *(f"q_{n}" for n in REQUIRED))))
    words = ["new-study", tmp_path / "w_grf.csv", tmp_path / "w_ik.csv", "--rig", "body", "--set", "mass_kg=70"]
    assert "please add --set height_m=NUMBER (m)" in fails(monkeypatch, capsys, *words)
    assert run(monkeypatch, *words, "--set", "height_m=1.8", "--set", "belt_speed_mps=1.1") == 0
    study = read_study(tmp_path)
    assert study.constants == {"mass_kg": 70.0, "height_m": 1.8} and study.trials[0].conditions["belt_speed_mps"] == 1.1
    out = capsys.readouterr().out
    assert "wrote" in out and "odd" not in out  # numbers of a walk need its inverse dynamics
    assert fails(monkeypatch, capsys, *words[:2], *words[3:], "--force").endswith(
        "found 0 of coordinates and 1 of ground reaction"
    )


def test_at_a_terminal_it_asks(monkeypatch, capsys, tmp_path):
    time, angle, _ = TRIALS[0]
    path = tmp_path / "a.csv"
    path.write_text(plain((1e3 * time, np.degrees(angle)), ("time", "Angle")))
    asked = []

    def answer(question):
        asked.append(question)
        return "time:ms" if question.startswith("time_s") else "Angle:deg"

    monkeypatch.setattr(own, "_ask", answer)
    for stream in (sys.stdin, sys.stdout):
        monkeypatch.setattr(stream, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(own.sys, "stdin", sys.stdin)
    assert run(monkeypatch, "new-study", path, "--rod", LENGTH, MASS) == 0
    assert len(asked) == 2
    assert read_study(tmp_path).trials[0].dt == pytest.approx(0.005)


WRONG = {
    "no_files": ((), "expected recordings, or --pendulum LENGTH MASS"),
    "no_urdf": (("FILE",), "--urdf: expected --urdf FILE, or --pendulum"),
    "two_urdfs": (("FILE", "--rod", 1, 1, "--slide", 2), "expected one of --pendulum, --rod, --slide and"),
    "no_mass": (("FILE", "--rod", 1, 0), "--rod: expected a mass above 0 kg"),
    "unknown_rig": (("FILE", "--rig", "knee"), "--rig: expected one of"),
    "body": (("FILE", "--rig", "body"), "expected UTF-8 text"),
    "body_with_a_urdf": (("FILE", "--rig", "body", "--rod", 1, 1), "expected no URDF, --column"),
    "unknown_column": (("FILE", "--rod", 1, 1, "--column", "angle=x"), "--column: unknown"),
    "no_such_column": (("FILE", "--rod", 1, 1, "--column", "position=x:deg"), "expected a column of the files"),
    "unknown_setting": (("FILE", "--rod", 1, 1, "--set", "mass=1"), "--set mass"),
    "no_number": (("FILE", "--rod", 1, 1, "--set", "damping=x"), "--set damping: expected a number, found 'x'"),
    "negative": (("FILE", "--rod", 1, 1, "--set", "damping=-1"), "--set damping: expected a number of at least 0"),
    "wrong_unit": (("FILE", "--rod", 1, 1, "--column", "position=Winkel [°]:mm"), "--column position: expected a unit"),
    "other_file": (("FILE", "--rod", 1, 1, "--set", "x.csv:start_s=1"), "expected one of the files, found 'x.csv'"),
    "twice": (("FILE", "FILE", "--rod", 1, 1), "was named twice"),
    "kind": (("FILE", "--rod", 1, 1, "--set", "kind=isometric"), "--set kind: expected one of motion"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_wrong_words_are_one_line_and_write_nothing(monkeypatch, capsys, recordings, case):
    words, said = WRONG[case]
    before = sorted(recordings.iterdir())
    words = [recordings / "m0.csv" if w == "FILE" else w for w in words]
    assert said in fails(monkeypatch, capsys, "new-study", *words)
    assert sorted(recordings.iterdir()) == before


def test_a_urdf_with_an_inertia_that_no_body_has_is_refused(tmp_path, monkeypatch, capsys):
    (tmp_path / "0.csv").write_bytes(german(0).encode("cp1252"))
    urdf = tmp_path / "rod.urdf"
    assert run(monkeypatch, "new-study", "--rod", LENGTH, MASS, "--out", tmp_path) == 0
    urdf.write_text(re.sub(r'izz="[^"]*"', 'izz="0.9"', urdf.read_text()))
    capsys.readouterr()
    said = fails(monkeypatch, capsys, "new-study", tmp_path / "0.csv", "--urdf", urdf)
    assert "rod.urdf, row 6, column arm: no body has the principal moments" in said
