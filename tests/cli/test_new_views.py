"""What `fes-pin new-study` proposes of recordings that are not one trial each."""

import tomllib

import numpy as np
import pytest
from cli.test_own import LENGTH, MASS, fails, run

from fes_pin.data.study import read_study
from fes_pin.data.table import format_csv

ROD = ("--rod", LENGTH, MASS)
TIME = np.arange(0.0, 6.0, 0.01)


def swing(time, phase=0.0):
    return 0.5 * np.exp(-0.2 * time) * np.cos(5.0 * time + phase)


def write(path, **columns):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(format_csv(columns))
    return path


def trials(folder):
    return tomllib.loads((folder / "study.toml").read_text())["trial"]


def test_two_recordings_in_one_file(monkeypatch, capsys, tmp_path):
    twice = write(tmp_path / "a.csv", time_s=np.r_[TIME, TIME], position=np.r_[swing(TIME), swing(TIME, 1.0)])
    assert run(monkeypatch, "new-study", twice, *ROD) == 0
    assert "a.csv: 2 recordings in one file: time starts again in row 602" in capsys.readouterr().out
    assert trials(tmp_path)[0]["split"] == "restarts"
    assert len(read_study(tmp_path)) == 2


def test_what_is_said_is_not_proposed_again(monkeypatch, capsys, tmp_path):
    kept = (TIME < 2.0) | (TIME > 2.2)
    path = write(tmp_path / "a.csv", time_s=TIME[kept], position=swing(TIME[kept]))
    assert run(monkeypatch, "new-study", path, *ROD) == 0
    assert "a.csv: 1 hole, the longest 2" in capsys.readouterr().out
    assert trials(tmp_path)[0]["split"] == "holes"
    assert run(monkeypatch, "new-study", path, *ROD, "--set", "from=2.5", "--set", "a.csv:to=5", "--force") == 0
    assert trials(tmp_path)[0] == {"file": "a.csv", "kind": "motion", "from": 2.5, "to": 5.0}
    (trial,) = read_study(tmp_path)
    assert (trial.time[0], trial.time[-1]) == (2.5, 5.0)
    capsys.readouterr()
    assert "split" in fails(monkeypatch, capsys, "new-study", path, *ROD, "--split", "none", "--force")
    assert run(monkeypatch, "new-study", path, *ROD, "--resample", "20", "--force") == 0  # which bridges the hole
    assert "split" not in trials(tmp_path)[0]


@pytest.mark.parametrize(("names", "is_said"), [(("alpha", "volts"), True), (("run1", "run2"), False)])
def test_files_without_names_at_the_same_times_are_doubted(names, is_said, monkeypatch, capsys, tmp_path):
    rows = [np.column_stack([TIME, one]) for one in (swing(TIME), np.sin(3.0 * TIME))]
    for name, table in zip(names, rows, strict=True):
        np.savetxt(tmp_path / name, table, "%.5f", ",")
    files, named = [tmp_path / n for n in names], ("--column", "time_s=column1:s")
    first = ("--column", "position=column2:rad")
    assert run(monkeypatch, "new-study", *files, *ROD, *named, *first, "--out", tmp_path / "s") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert ("where they are quantities of one trial, say --source NAME=FILE of each" in said) == is_said


def test_a_time_beyond_every_number_is_rejected_in_one_line(monkeypatch, capsys, tmp_path):
    times = [f"{10 * k}" if k != 7 else "1e400" for k in range(40)]
    path = tmp_path / "a.csv"
    path.write_text("t,position\nms,rad\n" + "".join(f"{t},{k % 5}\n" for k, t in enumerate(times)))
    assert "a.csv" in fails(monkeypatch, capsys, "new-study", path, *ROD)


@pytest.mark.parametrize("rig", [("--slide", "1"), ROD])
def test_readings_whose_squares_are_beyond_every_number_are_rejected_in_one_line(rig, monkeypatch, capsys, tmp_path):
    reading = np.where(np.arange(len(TIME)) % 2 == 0, 9.999e299, np.sin(TIME))
    path = write(tmp_path / "a.csv", time_s=TIME, position=np.where(TIME < 3.0, reading, np.sin(TIME)))
    assert "below 1e+100" in fails(monkeypatch, capsys, "new-study", path, *rig)


def test_a_source_is_named_by_the_end_of_its_path(monkeypatch, tmp_path):
    angle = write(tmp_path / "one/angle.csv", time_s=TIME, position=swing(TIME))
    volts = write(tmp_path / "one/volts.csv", time_s=TIME, effort=np.sin(3.0 * TIME))
    sources = ("--source", "angle=one/angle.csv", "--source", f"volts={volts}")
    assert run(monkeypatch, "new-study", angle, volts, *ROD, *sources, "--out", tmp_path / "s") == 0
    (trial,) = trials(tmp_path / "s")
    assert set(trial["sources"]) == {"angle", "volts"}


def test_one_quantity_a_file(monkeypatch, capsys, tmp_path):
    for number in (1, 2):
        for word, values in (("pos", swing(TIME, number)), ("tau", np.sin(3.0 * TIME))):
            rows = zip(TIME, values, strict=True)
            (tmp_path / f"run_{word}{number}.t").write_text("\n".join(f" {t:.4f}  {v:.5f}" for t, v in rows))
    files = sorted(tmp_path.glob("*.t"))
    said = fails(monkeypatch, capsys, "new-study", *files, *ROD)
    assert "position=pos.column2:UNIT" in said
    assert "column1:UNIT (0 to 5.99: s" in said
    units = ("time_s=column1:s", "position=pos.column2:rad", "effort=tau.column2:Nm")
    asked = [word for one in units for word in ("--column", one)]
    assert run(monkeypatch, "new-study", *files, *ROD, *asked) == 0
    assert "run_pos1.t and run_tau1.t are one trial" in capsys.readouterr().out
    found = read_study(tmp_path)
    assert [t.name for t in found] == ["run_pos1", "run_pos2"]
    assert np.allclose(found.trials[1]["position"], swing(TIME, 2), atol=1e-5)
    assert np.allclose(found.trials[0]["effort"], np.sin(3.0 * TIME), atol=1e-5)


@pytest.mark.parametrize("names", [("walk_slow", "walk_fast"), ("left_1", "right_1"), ("a", "b")])
def test_files_that_are_trials_by_themselves_stay_so(monkeypatch, tmp_path, names):
    files = [write(tmp_path / f"{n}.csv", time_s=TIME, position=swing(TIME), effort=np.sin(TIME)) for n in names]
    assert run(monkeypatch, "new-study", *files, *ROD) == 0
    assert len(read_study(tmp_path)) == 2


def test_two_loggers_with_clocks_of_their_own(monkeypatch, capsys, tmp_path):
    fine = np.arange(0.0, 6.0, 1e-3)
    speed = sum(np.sin(2.0 * np.pi * f * fine + p) for f, p in ((0.5, 0.3), (1.3, 1.0), (2.1, 2.0)))
    effort = 0.5 * np.gradient(speed, fine) + 0.3 * speed
    write(tmp_path / "x_motor.csv", time_s=fine, velocity=speed)
    write(tmp_path / "x_cell.csv", time_s=fine[::2] + 0.0123, torque_nm=effort[::2])
    files = sorted(tmp_path.glob("x_*.csv"), reverse=True)
    assert run(monkeypatch, "new-study", *files, "--wheel", "0.5", "--column", "velocity=motor.velocity:rad/s") == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "x_motor.csv and x_cell.csv are one trial" in printed
    assert "-12.3 ms are added to the times of cell: fitted" in printed
    (trial,) = read_study(tmp_path)
    rows = slice(100, -100)
    wanted = np.interp(trial.time, fine, effort)
    assert np.abs(trial["effort"] - wanted)[rows].max() < 0.03 * np.abs(wanted).max()
    assert set(trial.columns) == {"position", "effort"}
    given = ("--offset", "cell=-0.0123", "--column", "velocity=motor.velocity:rad/s", "--force")
    assert run(monkeypatch, "new-study", *files, "--wheel", "0.5", *given) == 0
    assert trials(tmp_path)[0]["offset_s"] == {"cell": -0.0123}


def test_sources_are_said_by_patterns(monkeypatch, capsys, tmp_path):
    for n in (1, 2):
        write(tmp_path / f"pos{n}.csv", time_s=TIME, position=swing(TIME, n))
        write(tmp_path / f"load_cell_{n}.csv", time_s=TIME, effort=np.sin(TIME))
    files = sorted(tmp_path.glob("*.csv"))
    both = ("--source", "pos=pos*", "--source", "cell=load*")
    assert run(monkeypatch, "new-study", *files, *ROD, *both) == 0
    assert [list(t["sources"]) for t in trials(tmp_path)] == [["pos", "cell"]] * 2
    capsys.readouterr()
    assert "--source cell: expected a pattern of one of the files" in fails(
        monkeypatch, capsys, "new-study", *files, *ROD, "--source", "cell=x*", "--force"
    )
    assert "expected as many files of each source" in fails(
        monkeypatch, capsys, "new-study", *files[:3], *ROD, *both, "--force"
    )


def test_a_rest_and_a_push_by_hand_are_no_free_motion(monkeypatch, capsys, tmp_path):
    since = TIME - 2.0
    hand = 0.5 * np.sin(0.5 * np.pi * np.clip((TIME - 1.2) / 0.8, 0.0, 1.0)) ** 2
    position = np.where(since > 0.0, 0.5 * np.exp(-1.5 * since) * np.cos(6.0 * since), hand)
    path = write(tmp_path / "a.csv", time_s=TIME, position=position)
    assert run(monkeypatch, "new-study", path, *ROD) == 0
    assert "a.csv: rest, a push by hand, free motion: the free part from 2" in capsys.readouterr().out
    assert abs(trials(tmp_path)[0]["from"] - 2.0) < 0.03


def test_a_speed_alone_is_a_rig(monkeypatch, capsys, tmp_path):
    path = write(tmp_path / "a.csv", time_s=TIME, **{"speed [rpm]": 30.0 * np.sin(TIME), "torque [Nm]": np.cos(TIME)})
    assert run(monkeypatch, "new-study", path, "--wheel", "0.02") == 0
    assert trials(tmp_path)[0]["derive"] == {"position": "velocity"}
    (trial,) = read_study(tmp_path)
    assert np.allclose(trial["position"], np.pi * (1.0 - np.cos(TIME)), atol=1e-4)


@pytest.mark.parametrize("seed", range(6))
def test_times_that_jitter_are_resampled_at_the_usual_step_and_said(monkeypatch, capsys, tmp_path, seed):
    rng = np.random.default_rng(seed)
    step = rng.choice([0.002, 0.005, 0.01, 0.05])
    time = step * np.arange(400) + rng.uniform(0.0, 0.3 * step, 400)
    jittered = write(tmp_path / "a.csv", time_s=time, position=swing(time))
    even = write(tmp_path / "b.csv", time_s=TIME, position=swing(TIME, 1.0))
    assert run(monkeypatch, "new-study", jittered, even, *ROD) == 0
    said = " ".join(capsys.readouterr().out.split())
    rate, none = [one.get("rate") for one in trials(tmp_path)]
    assert rate == pytest.approx(1 / step, rel=0.02) and none is None
    assert f"ms are interpolated to {rate:g} Hz, without a filter in trial a" in said
    first, second = read_study(tmp_path)
    assert np.allclose(np.diff(first.time), 1 / rate) and len(second.time) == len(TIME)
    assert run(monkeypatch, "new-study", jittered, even, *ROD, "--resample", "20", "--force") == 0
    assert not any("rate" in one for one in trials(tmp_path))


@pytest.mark.parametrize("digits", [2, 3, 4])
def test_equal_steps_that_were_rounded_are_not_resampled(monkeypatch, tmp_path, digits):
    time = np.round(np.arange(300) / 60.0, digits)
    write(tmp_path / "a.csv", time_s=time, position=swing(time))
    assert run(monkeypatch, "new-study", tmp_path / "a.csv", *ROD) == 0
    assert "rate" not in trials(tmp_path)[0]


def test_steps_between_recordings_of_one_file_do_not_count(monkeypatch, tmp_path):
    kept = (TIME < 2.0) | (TIME > 2.2)
    for name, time in (("a", TIME[kept]), ("b", np.r_[TIME, TIME])):
        path = write(tmp_path / name / "a.csv", time_s=time, position=swing(time))
        assert run(monkeypatch, "new-study", path, *ROD) == 0
        assert "rate" not in trials(path.parent)[0]


@pytest.mark.parametrize("sign", ["#", "%", "//"])
def test_files_with_more_or_fewer_comments_are_one_study(monkeypatch, tmp_path, sign):
    for name, count in (("a", 1), ("b", 4), ("c", 0)):
        lines = [f"{sign} note {k}" for k in range(count)]
        (tmp_path / f"{name}.csv").write_text(
            "\n".join([*lines, format_csv({"time_s": TIME, "position": swing(TIME)})])
        )
    files = [tmp_path / f"{name}.csv" for name in "ab"]
    assert run(monkeypatch, "new-study", *files, *ROD) == 0
    about = tomllib.loads((tmp_path / "study.toml").read_text())["columns"]["file"]
    assert about == {"header_row": "after comments", "comment": sign}
    assert [len(t.time) for t in read_study(tmp_path)] == [len(TIME)] * 2


def test_a_balanced_wheel_may_turn_on(monkeypatch, capsys, tmp_path):
    rng = np.random.default_rng(1)
    speed = np.minimum(15.0 * TIME, 40.0)
    path = write(tmp_path / "a.csv", time_s=TIME, position=np.cumsum(speed) * 0.01, effort=np.exp(rng.normal(size=600)))
    assert run(monkeypatch, "new-study", path, "--wheel", "0.001") == 0
    assert "degrees" not in capsys.readouterr().out
    assert run(monkeypatch, "new-study", path, *ROD, "--force") == 0
    assert "turns: is it in degrees?" in capsys.readouterr().out


def test_a_file_without_a_position_is_asked_for_a_speed(monkeypatch, capsys, tmp_path):
    path = write(tmp_path / "a.csv", **{"time_s": TIME, "measured [Hz]": swing(TIME), "shaft [Hz]": swing(TIME, 1.0)})
    said = fails(monkeypatch, capsys, "new-study", path, *ROD)
    assert "--column position=NAME:UNIT (one of " in said
    assert said.rstrip().endswith("; without one --column velocity=NAME:UNIT is integrated)")
    assert run(monkeypatch, "new-study", path, *ROD, "--column", "velocity=shaft [Hz]:rev/s") == 0
    assert trials(tmp_path)[0]["derive"] == {"position": "velocity"}


@pytest.mark.parametrize("seed", range(8))
def test_what_is_no_hole_of_a_recording_is_none_of_its_parts(monkeypatch, tmp_path, seed):
    """Steps that grow: a part before a hole has a shorter usual step than the whole."""
    rng = np.random.default_rng(seed)
    steps = np.sort(rng.uniform(0.01, 0.012, 400))
    steps[rng.choice(400, 3, replace=False)] *= rng.uniform(4.4, 4.95, 3)
    steps[200] = 6.0 * np.median(steps)
    time = np.cumsum(steps)
    path = write(tmp_path / "a.csv", time_s=time, position=swing(time))
    assert run(monkeypatch, "new-study", path, *ROD) == 0
    assert len(read_study(tmp_path)) >= 2


@pytest.mark.parametrize("bad", ["", "nan", "back"])
def test_times_that_do_not_increase_get_no_rate(monkeypatch, capsys, tmp_path, bad):
    lines = format_csv({"time_s": TIME, "position": swing(TIME)}).splitlines()
    lines[40] = {"back": lines[30]}.get(bad, f"{bad},0.1")
    (tmp_path / "a.csv").write_text("\n".join(lines))
    said = fails(monkeypatch, capsys, "new-study", tmp_path / "a.csv", *ROD)
    assert "row 41, column time_s" in said and not (tmp_path / "study.toml").exists()


@pytest.mark.parametrize("unit", ["rpm", "A", "V", "deg/s"])
def test_a_unit_of_another_quantity_wants_a_scale(monkeypatch, capsys, tmp_path, unit):
    path = write(tmp_path / "a.csv", time_s=TIME, speed=swing(TIME))
    words = ("new-study", path, "--slide", "2", "--column")
    said = fails(monkeypatch, capsys, *words, f"velocity=speed:{unit}")
    assert f"found {unit!r}; of another quantity NAME,scale=NUMBER (m/s for each)" in said
    assert run(monkeypatch, *words, "velocity=speed,scale=0.02") == 0


@pytest.mark.parametrize("column", ["t [ms]", "Angle"])
def test_a_word_among_the_numbers_of_a_free_motion_is_named_by_its_place(monkeypatch, capsys, tmp_path, column):
    path = write(tmp_path / "a.csv", **{"t [ms]": 1e3 * TIME, "Angle": swing(TIME)})
    lines = path.read_text().splitlines()
    lines[40] = ",".join(
        "twelve" if n == column else v for n, v in zip(("t [ms]", "Angle"), lines[40].split(","), strict=True)
    )
    path.write_text("\n".join(lines))
    said = ("--column", "time_s=t [ms]:ms", "--column", "position=Angle:rad")
    printed = fails(monkeypatch, capsys, "new-study", path, *ROD, *said)
    assert f"row 41, column {column}: expected a number, found 'twelve'" in printed
    assert not (tmp_path / "study.toml").exists()
