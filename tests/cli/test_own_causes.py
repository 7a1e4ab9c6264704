"""Causes and rigs of one's own that fail, when they are loaded or later: one line and exit code 2 of every command."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

import fes_pin as fp
from fes_pin.cli import main

DOCUMENT = Path(__file__).parents[2] / "docs" / "own_causes_and_rigs.md"
FILES = dict(re.findall(r"```python\n# (\w+\.py)\n(.*?)```", DOCUMENT.read_text(), re.DOTALL))
CAUSE, RIG = FILES["door_closer.py"], FILES["tail.py"]
LATER = """
    @classmethod
    def grids(cls, measured):
        if len(measured["time"]) > 100:
            raise RuntimeError("a long record")
        return super().grids(measured)
"""
"""What fails with measured trials, and does not before there are any."""
LIMITED = LATER.replace("@classmethod\n    def grids(cls,", "def limits(self,").replace("grids", "limits")


def fails(monkeypatch, capsys, *words):
    monkeypatch.setattr(sys, "argv", ["fes-pin", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main.main()
    printed = capsys.readouterr()
    lines = [one for one in printed.err.splitlines() if " runs the code of " not in one]
    assert (ended.value.code, printed.out, len(lines)) == (2, "", 1)
    return lines[0]


def table(columns):
    rows = zip(*columns.values(), strict=True)
    return "\n".join([",".join(columns), *(",".join(f"{x:.9g}" for x in row) for row in rows)]) + "\n"


def tails(folder):
    """Tails under motors that turn them, in two groups; nothing is hidden."""
    folder.mkdir()
    lines = ['[study]\nname = "tail"\nrig = "tail"\n', "[rig]\nstiffness_nm_per_rad = 0.9\n"]
    lines.append("[start]\ninertia_kgm2 = 0.025\ndamping_nms = 0.02\n")
    rng, time = np.random.default_rng(3), 0.01 * np.arange(200)
    for k in range(4):
        motor = np.repeat(rng.uniform(-0.4, 0.4, 8), 25) * (time > 0.1)
        state, angle = np.zeros(2), []
        for torque in motor:
            angle.append(state[0])
            for _ in range(10):
                state = state + 1e-3 * np.array([state[1], (torque - 0.9 * state[0] - 0.01 * state[1]) / 0.02])
        noisy = np.array(angle) + 1e-3 * rng.standard_normal(len(time))
        (folder / f"{k}.csv").write_text(table({"time_s": time, "motor_nm": motor, "angle_rad": noisy}))
        lines.append(f'[[trial]]\nfile = "{k}.csv"\ngroup = "{"ab"[k % 2]}"\n')
    (folder / "study.toml").write_text("\n".join(lines))
    return folder


def muscles(folder):
    """Held muscles under steps of pulse width."""
    folder.mkdir()
    lines = ['[study]\nname = "m"\nrig = "muscle"\n', "[rig]\nthreshold_us = 100.0\nsaturation_us = 500.0\n"]
    lines.append("[start]\ngain = 30.0\ntime_constant_s = 0.05\n")
    rng, time = np.random.default_rng(3), 0.01 * np.arange(200)
    for k in range(3):
        width = np.repeat(rng.uniform(100.0, 500.0, 8), 25) * (time > 0.1)
        force = 30.0 * np.convolve(np.clip((width - 100.0) / 400.0, 0.0, 1.0), np.exp(-time / 0.05))[:200] * 0.18
        columns = {"time_s": time, "pulse_width_us": width, "force_n": force + 0.1 * rng.standard_normal(len(time))}
        (folder / f"{k}.csv").write_text(table(columns))
        lines.append(f'[[trial]]\nfile = "{k}.csv"\n')
    (folder / "study.toml").write_text("\n".join(lines))
    return folder


@pytest.fixture
def own(tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return tmp_path


BROKEN = CAUSE.replace("return value", "value")


@pytest.mark.parametrize("command", ["effects", "diagnose", "check", "contrast", "compare", "cohort", "predict"])
def test_a_cause_that_is_wrong_is_refused_when_it_is_loaded(command, own, monkeypatch, capsys):
    (own / "wrong.py").write_text(BROKEN)
    study = [] if command == "effects" else [tails(own / "study")]
    out = {"effects": (), "check": (), "predict": (study[0] / "0.csv", "--out", own / "out.csv") if study else ()}
    more = out.get(command, ("--out", own / "out"))
    said = fails(
        monkeypatch, capsys, command, *study, *more, "--library", own / "tail.py", "--library", own / "wrong.py"
    )
    row = 1 + next(k for k, line in enumerate(BROKEN.splitlines()) if "def apply" in line)
    assert said == f"fes-pin: {own / 'wrong.py'}, row {row}: class DoorCloser: apply returns None; expected numbers"
    assert not (own / "out").exists()


def test_what_fails_later_is_one_line_of_every_command(own, monkeypatch, capsys):
    path, row = own / "wrong.py", 1 + next(k for k, n in enumerate((CAUSE + LATER).splitlines()) if "raise" in n)
    path.write_text(CAUSE + LATER)
    study, libraries = tails(own / "study"), ("--library", own / "tail.py", "--library", path)
    for command in ("diagnose", "check", "contrast", "cohort"):
        words = () if command == "check" else ("--out", own / "out")
        said = fails(monkeypatch, capsys, command, study, *words, *libraries, "--quiet")
        assert f"{path}, row {row}: class DoorCloser: RuntimeError: a long record" in said, command
    assert not (own / "out" / "cohort.html").exists() and not (own / "out" / "diagnosis.json").exists()


def test_a_cause_of_a_compared_model_that_fails_later_is_one_line(own, monkeypatch, capsys):
    text = CAUSE.replace('"torque", ("joint",)', '"force", ("muscle",)').replace("s.v", "s.act") + LIMITED
    (own / "wrong.py").write_text(text)
    study, cause = muscles(own / "study"), fp.load_library(own / "wrong.py").effect("door_closer")
    fp.save_model(fp.nominal_model(fp.read_study(study)) + cause(), own / "model.toml")
    words = ("compare", study, "--models", "nominal", "--model", own / "model.toml", "--library", own / "wrong.py")
    assert "wrong.py, row 28: class DoorCloser: RuntimeError: a long record" in fails(monkeypatch, capsys, *words)


def test_a_rig_that_fails_later_is_one_line_of_a_prediction(own, monkeypatch, capsys):
    text = RIG.replace(
        '        return {"stiffness', '        begin = begin / (begin - 0.5)\n        return {"stiffness'
    )
    (own / "wrong.py").write_text(text)
    rig = next(one for one in fp.load_library(own / "wrong.py").rigs if one.name == "tail")
    fp.save_model(fp.Model(rig(constants={"stiffness_nm_per_rad": 0.9})), own / "model.toml")
    trial = own / "trial.csv"
    trial.write_text(table({"time_s": 0.01 * np.arange(9), "motor_nm": np.zeros(9)}))
    words = ("predict", own / "model.toml", trial, "--set", "angle0_rad=0.5", "--library", own / "wrong.py")
    said = fails(monkeypatch, capsys, *words, "--out", own / "made.csv")
    assert re.search(r"wrong.py, row \d+: class Tail: ZeroDivisionError: float division by zero", said)
    assert not (own / "made.csv").exists()
