"""`fes-pin diagnose`, `predict` and `effects`: exit codes, one line for bad input, files whole or not at all."""

import json
import os
import re
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from data import studies, test_bad_studies
from diagnosis.hidden import study_of

import fes_pin as fp
from fes_pin.cli import main
from fes_pin.data.outputs import Outputs
from fes_pin.data.results import NEXT_FILE
from fes_pin.data.study import read_study, write_study
from fes_pin.data.trial_files import read_trial, write_trial
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.identify.stored import load_random
from fes_pin.infer.noise import estimate_noise
from fes_pin.models.effects import EFFECTS
from fes_pin.models.parameters import ROTARY
from fes_pin.models.simulate import simulate
from fes_pin.models.store import load_model, model_toml, save_model

FILES = {"diagnosis.json", "model.toml", "report.html"}
SAVED = ("result", "text", "table")
"""Keys by which `fp.load_result` reads the file."""


def run(monkeypatch, *words):
    """Run the command line in this process; its exit code."""
    monkeypatch.setattr(sys, "argv", ["fes-pin", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main.main()
    return ended.value.code or 0


def fails(monkeypatch, capsys, *words):
    """The one line on standard error of a command that must end with 2."""
    assert run(monkeypatch, *words) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1 and printed.err.endswith("\n")
    return printed.err.strip()


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """An ankle study on disk with friction hidden in it, and its diagnosis by the command line on one thread."""
    folder = tmp_path_factory.mktemp("made")
    small = study_of("ankle", ("coulomb_friction",), "ar1", 40, n_motion=3, n_isometric=1, duration_s=4.0)
    write_study(small, folder / "study")
    by_command(folder, folder / "one", "1")
    return folder


@pytest.fixture(scope="module")
def diagnosis(made):
    """The same by the library."""
    return diagnose_joint(read_study(made / "study"))


def by_command(folder, out, threads):
    """Diagnose in a process of its own, with this many threads of ours and of the linear algebra's."""
    known = dict.fromkeys(("FES_PIN_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), threads)
    words = [sys.executable, "-m", "fes_pin.cli.main", "diagnose", str(folder / "study"), "--out", str(out)]
    return subprocess.run(words, check=True, capture_output=True, text=True, env={**os.environ, **known})


def record(folder):
    found = json.loads((folder / "diagnosis.json").read_text())
    assert found.pop("wall_s") > 0.0
    assert found.pop("provenance")["seed"] == 0
    return {n: v for n, v in found.items() if n not in SAVED}


def test_the_answer_does_not_depend_on_threads(made):
    answered = by_command(made, made / "two", "2")
    assert record(made / "one") == record(made / "two")
    assert (made / "one/model.toml").read_bytes() == (made / "two/model.toml").read_bytes()
    assert {p.name for p in (made / "one").iterdir()} >= FILES
    assert "coulomb_friction" in answered.stdout and "report.html" in answered.stdout


def test_the_library_says_the_same(made, diagnosis):
    by_library = json.loads(json.dumps(diagnosis.record()))
    by_library.pop("wall_s")
    by_library.pop("provenance")
    assert by_library == record(made / "one")
    assert diagnosis.files()["model.toml"] == (made / "one/model.toml").read_text()


def test_what_the_command_wrote_is_loaded(made, diagnosis):
    loaded = fp.load_result(made / "one/diagnosis.json")
    assert loaded == diagnosis and hash(loaded) == hash(diagnosis)
    assert str(loaded) == str(diagnosis) and loaded.verdict == diagnosis.verdict == "causes_found"


def test_the_seed_changes_only_what_is_simulated(made):
    found = diagnose_joint(read_study(made / "study"), seed=7).record()
    usual = record(made / "one")
    for key in ("study", "verdict", "absorbed", "nominal", "extended", "noise", "ceiling_percent"):
        assert json.loads(json.dumps(found[key])) == usual[key], key
    for one, other in zip(found["causes"], usual["causes"], strict=True):
        for key in ("name", "stage", "parameters", "equivalents"):
            assert json.loads(json.dumps(one[key])) == other[key]
        assert one["gain_percent"]["held_out"] == other["gain_percent"]["held_out"]
    assert found["causes"][0]["gain_percent"]["ci95"] != usual["causes"][0]["gain_percent"]["ci95"]


def test_every_cause_has_an_answer_to_why(made, diagnosis, tmp_path, monkeypatch, capsys):
    words = [word for name in ("coulomb_friction", "sensor_lag", "nonsense") for word in ("--why", name)]
    monkeypatch.setenv("COLUMNS", "1000")
    refused = ("--fail-on", "unexplained", "--fail-on", "causes_found")
    assert run(monkeypatch, "diagnose", made / "study", "--out", tmp_path / "why", *words, *refused) == 1
    named, other, unknown = capsys.readouterr().out.splitlines()[-4:-1]
    assert named.startswith("coulomb_friction: named (p ") and "twice the log-likelihood" in named
    assert other.startswith("sensor_lag: ") and diagnosis.explain("sensor_lag") == [other]
    assert unknown.startswith("nonsense: not fitted; candidates were ") and "sensor_lag" in unknown
    told = record(tmp_path / "why")["why"]
    assert (
        set(told) == {"estimator", "level", "steps", "further_p_value", "rejected", "tried", "faults_of_record"}
        and "sensor_lag" in told["tried"]
    )
    searched = {*told["tried"], *told["rejected"], *diagnosis.absorbed, *(c.name for c in diagnosis.causes)}
    assert searched >= {e.name for e in EFFECTS if "ankle" in e.rigs and not e.is_fault}
    assert "Why these, and no others" in (tmp_path / "why/report.html").read_text()


def test_a_verdict_that_does_not_exist_is_refused_before_any_work(made, tmp_path, monkeypatch, capsys):
    asked = ("diagnose", made / "study", "--out", tmp_path / "no", "--fail-on", "wrong")
    assert run(monkeypatch, *asked) == 2
    assert "causes_found" in capsys.readouterr().err and not (tmp_path / "no").exists()


def test_the_record_is_as_the_contract_says(made):
    found = json.loads((made / "one/diagnosis.json").read_text())
    assert list(found) == [
        *(
            "study",
            "verdict",
            "causes",
            "remainder",
            "explained",
            "errors",
            "next",
            "assumed",
            "absorbed",
            "nominal",
            "extended",
            "noise",
        ),
        *("ceiling_percent", "next_experiment", "horizon_s", "why", "warnings", "wall_s", "provenance", *SAVED),
    ]
    (cause,) = found["causes"]
    keys = [
        "name",
        "stage",
        "sentence",
        "equation",
        "parameters",
        "equivalents",
        "p_value",
        "gain_percent",
        "judged_by",
    ]
    assert list(cause) == keys
    assert cause["sentence"] == "Dry friction at the joint." and "T = torque\n" in cause["equation"]
    assert not re.search("stiction|stribeck|load|STIFFEST|one_way", cause["equation"])
    assert cause["name"] == "coulomb_friction" and cause["stage"] == "joint"
    assert set(cause["parameters"]["torque_nm"]) == {"value", "std", "low", "high"}
    assert set(cause["gain_percent"]) == {"fit", "held_out", "ci95"}
    assert set(found["remainder"]) == {"unexplained", "p_value", "level", "where"}
    assert set(found["noise"]) == {"angle_rad", "force_n"}
    assert found["extended"]["error_percent"]["held_out"] < found["nominal"]["error_percent"]["held_out"]
    before, after = (found[which]["error_percent"] for which in ("nominal", "extended"))
    assert set(before) == {"fit", "held_out", "one_step", "horizon", "free"}
    assert before["one_step"] <= before["horizon"] < before["free"]
    assert all(after[n] < before[n] for n in after)


def test_a_prediction_over_a_horizon_goes_on_from_what_was_measured(made, monkeypatch, capsys, tmp_path):
    """A nominal model's residual foretells itself: the better, the shorter the horizon."""
    study, errors = read_study(made / "study"), {}
    nominal = load_model(made / "one/model.toml") - "coulomb_friction"
    residual = [t["angle_rad"] - simulate(nominal, t)["angle_rad"] for t in study.trials if t.kind == "motion"]
    table = {"noise": {"angle_rad": _table(estimate_noise(residual))}}
    (tmp_path / "model.toml").write_text(model_toml(nominal, {"random": table}))
    trial = next(t for t in study.trials if t.kind == "motion")
    write_trial(trial, tmp_path / "trial.csv")
    settings = [f"--set={n}={v!r}" for n, v in trial.conditions.items()]
    for horizon in ("0", "0.05", "0.3", "1e3"):
        out = tmp_path / "out.csv"
        given = ("predict", tmp_path / "model.toml", tmp_path / "trial.csv", *settings, "--out", out)
        assert run(monkeypatch, *given, "--horizon", horizon) == 0
        errors[horizon] = np.std(np.genfromtxt(out, delimiter=",", names=True)["angle_rad"] - trial["angle_rad"])
    assert errors["0"] < errors["0.05"] < errors["0.3"] < errors["1e3"]
    assert errors["1e3"] == pytest.approx(np.std(trial["angle_rad"] - simulate(nominal, trial)["angle_rad"]), rel=1e-6)
    save_model(nominal, tmp_path / "model.toml", overwrite=True)
    assert "[random]" in fails(monkeypatch, capsys, *given, "--horizon", "0.3")


def _table(noise):
    return {"std": noise.std, "innovation_std": noise.innovation_std, "step_s": noise.step_s, "ar": list(noise.ar)}


def test_a_prediction_needs_the_model_alone(made, monkeypatch, tmp_path):
    """The inputs of a trial and model.toml give what the fit gives, to 1e-9."""
    diagnosis_model = load_model(made / "one/model.toml")
    study = read_study(made / "study")
    for trial in study.trials:
        inputs = tmp_path / f"{trial.name}.csv"
        with inputs.open("w") as stream:
            stream.write("time_s,pulse_width_us\n")
            for t, w in zip(trial.time, trial["pulse_width_us"], strict=True):
                stream.write(f"{t!r},{w!r}\n".replace("np.float64(", "").replace(")", ""))
        settings = [f"--set={n}={v!r}" for n, v in trial.conditions.items()] + [f"--set=kind={trial.kind}"]
        out = tmp_path / f"{trial.name}-predicted.csv"
        assert run(monkeypatch, "predict", made / "one/model.toml", inputs, *settings, "--out", out) == 0
        column = "angle_rad" if trial.kind == "motion" else "force_n"
        got = np.genfromtxt(out, delimiter=",", names=True)
        assert got.dtype.names == ("time_s", column)
        assert np.abs(got[column] - simulate(diagnosis_model, trial)[column]).max() < 1e-9


def test_a_model_on_disk_is_the_fit_to_the_last_bit(made, diagnosis, tmp_path):
    loaded = load_model(made / "one/model.toml")
    assert loaded.parameters() == diagnosis.model.parameters()
    assert loaded.structure() == diagnosis.model.structure()
    save_model(loaded, tmp_path / "again.toml")
    whole = (made / "one/model.toml").read_text()
    assert whole.startswith((tmp_path / "again.toml").read_text())
    assert load_random(made / "one/model.toml") == diagnosis.extended.noise


BAD = [
    *(("ankle", "study.toml", *row[:2]) for row in test_bad_studies.TOML.values()),
    *(("ankle", "trials/00.csv", *row[:2]) for row in test_bad_studies.CSV.values()),
    *(("joint", *row[:3]) for row in test_bad_studies.JOINT.values()),
    *(("muscle", *row[:3]) for row in test_bad_studies.MUSCLE.values()),
]
NAMES = [name for table in ("TOML", "CSV", "JOINT", "MUSCLE") for name in getattr(test_bad_studies, table)]


@pytest.mark.parametrize("case", BAD, ids=NAMES)
def test_bad_input_is_one_line(monkeypatch, capsys, tmp_path, case):
    rig, file, old, new = case
    folder = getattr(studies, rig)(tmp_path / "study")
    (tmp_path / "10.csv").write_text(studies.MOTION)
    (folder / "link.csv").symlink_to("nowhere.csv")
    (folder / "out").symlink_to(tmp_path)
    test_bad_studies.make_fifo(folder / "pipe")
    test_bad_studies.spoil(folder / file, old, new)
    out = tmp_path / "answer"
    line = fails(monkeypatch, capsys, "diagnose", folder, "--out", out)
    assert line.startswith(f"fes-pin: {folder}")
    assert not out.exists()


def test_a_failed_write_leaves_the_old_answer(made, diagnosis, monkeypatch, capsys, tmp_path):
    """A rename fails, as if the disk were full: every old file is back and no new one stays."""
    out = tmp_path / "out"
    Outputs("diagnose").write(out, {name: f"old {name}" for name in FILES})
    old = {p.name: p.read_text() for p in out.iterdir()}
    monkeypatch.setattr("fes_pin.diagnosis.diagnosis.diagnose_joint", lambda *_, **__: diagnosis)
    usual, count = os.replace, []

    def replace(source, target):
        count.append(target)
        if len(count) == 6:
            raise OSError(28, "No space left on device")
        usual(source, target)

    monkeypatch.setattr(os, "replace", replace)
    line = fails(monkeypatch, capsys, "diagnose", made / "study", "--out", out)
    assert "No space left" in line
    assert {p.name: p.read_text() for p in out.iterdir()} == old


def test_what_an_earlier_diagnosis_proposed_does_not_stay(made, diagnosis, monkeypatch, tmp_path):
    Outputs("diagnose").write(tmp_path, {NEXT_FILE: "of another study"})
    decided = replace(diagnosis, next_experiment=None)
    monkeypatch.setattr("fes_pin.diagnosis.diagnosis.diagnose_joint", lambda *_, **__: decided)
    run(monkeypatch, "diagnose", made / "study", "--out", tmp_path)
    assert (tmp_path / "diagnosis.json").exists() and not (tmp_path / NEXT_FILE).exists()


def test_a_killed_report_leaves_no_folder(made, diagnosis, monkeypatch, tmp_path):
    """What ends the work before the files are complete leaves nothing."""
    monkeypatch.setattr("fes_pin.diagnosis.diagnosis.diagnose_joint", lambda *_, **__: diagnosis)
    monkeypatch.setattr("fes_pin.view.report.report_html", _killed)
    monkeypatch.setattr(sys, "argv", ["fes-pin", "diagnose", str(made / "study"), "--out", str(tmp_path / "out")])
    with pytest.raises((KeyboardInterrupt, SystemExit)):
        main.main()
    assert not (tmp_path / "out").exists()


def _killed(_):
    raise KeyboardInterrupt


SETTINGS = {
    "no_load": ((), "load_kg"),
    "not_a_number": (("--set=load_kg=heavy",), "load_kg"),
    "no_value": (("--set=load_kg",), "NAME=VALUE"),
    "no_name": (("--set==1",), "NAME=VALUE"),
    "unknown": (("--set=load_kg=1", "--set=weight=2"), "weight"),
    "negative": (("--set=load_kg=-1",), "load_kg"),
    "nan": (("--set=load_kg=nan",), "load_kg"),
    "twice": (("--set=load_kg=1", "--set=load_kg=2"), "once"),
    "kind_twice": (("--set=load_kg=1", "--set=kind=motion", "--set=kind=motion"), "once"),
    "underscore": (("--set=load_kg=1_0",), "load_kg"),
    "unknown_kind": (("--set=kind=running", "--set=load_kg=1"), "kind"),
    "isometric_without_angle": (("--set=kind=isometric",), "angle_rad"),
    "angle_of_a_motion": (("--set=load_kg=1", "--set=angle_rad=1.9"), "angle_rad"),
}


@pytest.mark.parametrize("case", SETTINGS)
def test_bad_settings(made, monkeypatch, capsys, tmp_path, case):
    settings, words = SETTINGS[case]
    trial, out = made / "study" / _first(made), tmp_path / "out.csv"
    line = fails(monkeypatch, capsys, "predict", made / "one/model.toml", trial, *settings, "--out", out)
    assert words in line
    assert not out.exists()


def _first(made):
    return tomllib.loads((made / "study/study.toml").read_text())["trial"][0]["file"]


MODELS = {  # old, new, words
    "not_toml": ("[nominal]", "[nominal", "not TOML"),
    "no_format": ("format = 1\n", "", "format = 1"),
    "other_format": ("format = 1", "format = 2", "format = 1"),
    "other_rig": ('rig = "ankle"', 'rig = "knee"', "expected one of"),
    "missing_nominal": ("gain = ", "gian = ", "gian"),
    "text": ("damping_nms = ", 'damping_nms = "x" # ', "expected a number, found the text 'x'"),
    "unknown_effect": ("[effects.coulomb_friction]", "[effects.gremlins]", "gremlins"),
    "effect_without_parameter": ("torque_nm = ", "# ", "torque_nm"),
    "effect_with_another": ("torque_nm = ", "torque = 1.0\ntorque_nm = ", "torque"),
    "not_a_number": ("torque_nm = ", "torque_nm = nan # ", "torque_nm"),
    "missing_constant": ("foot_mass_kg = ", "# ", "foot_mass_kg"),
    "format_is_true": ("format = 1", "format = true", "format = 1"),
    "rig_is_a_table": ('rig = "ankle"', "rig = {}", "found a table"),
    "fitted_is_a_table": ("fitted = [", "fitted = [{},", "expected names"),
    "fitted_twice": ("fitted = [", 'fitted = ["gain",', "each once"),
    "integer_of_400_digits": ("foot_mass_kg = ", f"foot_mass_kg = {'9' * 400} # ", "an integer of many digits"),
    "negative_mass": ("foot_mass_kg = ", "foot_mass_kg = -1 # ", "above 0 in kg"),
    "negative_gain": ("gain = ", "gain = -1 # ", "above 0"),
    "no_saturation": ("saturation_us = ", "saturation_us = 1.0 # ", "expected more than"),
    "mass_of_nothing": ("foot_mass_kg = ", "foot_mass_kg = inf # ", "foot_mass_kg"),
}


@pytest.mark.parametrize("case", MODELS)
def test_a_malformed_model(made, monkeypatch, capsys, tmp_path, case):
    old, new, words = MODELS[case]
    text = (made / "one/model.toml").read_text()
    assert old in text
    (tmp_path / "model.toml").write_text(text.replace(old, new, 1))
    trial, out = made / "study" / _first(made), tmp_path / "out.csv"
    line = fails(monkeypatch, capsys, "predict", tmp_path / "model.toml", trial, "--set=load_kg=1", "--out", out)
    assert str(tmp_path / "model.toml") in line and words in line
    assert not out.exists()


def test_nothing_there(made, monkeypatch, capsys, tmp_path):
    out = tmp_path / "out.csv"
    trial = made / "study" / _first(made)
    assert "none.toml" in fails(monkeypatch, capsys, "predict", tmp_path / "none.toml", trial, "--out", out)
    model = made / "one/model.toml"
    line = fails(monkeypatch, capsys, "predict", model, tmp_path / "none.csv", "--set=load_kg=1", "--out", out)
    assert "none.csv" in line
    line = fails(monkeypatch, capsys, "predict", model, trial, "--set=load_kg=1", "--out", tmp_path / "no/out.csv")
    assert "does not exist" in line
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def pendulum(tmp_path):
    """The nominal model of a pendulum on disk, and a swing of it."""
    study = read_study(studies.joint(tmp_path / "swing"))
    from fes_pin.models.nominal import nominal_model

    save_model(nominal_model(study), tmp_path / "model.toml")
    return tmp_path


START = {  # columns of the file, settings, initial position and velocity (None: the file's)
    "both_columns": ("position,velocity", (), None, None),
    "settings_win": ("position,velocity", ("--set=position0=0.3", "--set=velocity0=0.1"), 0.3, 0.1),
    "settings_alone": ("", ("--set=position0=0.3", "--set=velocity0=0.1"), 0.3, 0.1),
    "velocity_is_estimated": ("position", (), None, None),
    "one_setting": ("position,velocity", ("--set=velocity0=-0.5",), None, -0.5),
}


@pytest.mark.parametrize("case", START)
def test_a_joint_starts_at_its_first_sample(pendulum, monkeypatch, case):
    """Only the first samples of the outputs count: what follows may be anything."""
    columns, settings, position0, velocity0 = START[case]
    model = load_model(pendulum / "model.toml")
    time = np.arange(200) * 5e-3
    true = read_swing(pendulum, model, time)
    names = [n for n in columns.split(",") if n]
    data = {n: true[n].copy() for n in names}
    for values in data.values():
        values[50:] = 99.0
    table = np.column_stack([time, *data.values()]).tolist()
    rows = [",".join(["time_s", *names]), *(",".join(map(repr, row)) for row in table)]
    (pendulum / "in.csv").write_text("\n".join(rows) + "\n")
    out = pendulum / "out.csv"
    assert run(monkeypatch, "predict", pendulum / "model.toml", pendulum / "in.csv", *settings, "--out", out) == 0
    got = np.genfromtxt(out, delimiter=",", names=True)
    assert got.dtype.names == ("time_s", "position", "velocity")
    assert got["position"][0] == pytest.approx(true["position"][0] if position0 is None else position0, abs=1e-12)
    wanted = true["velocity"][0] if velocity0 is None else velocity0
    assert got["velocity"][0] == pytest.approx(wanted, abs=2e-2 if case == "velocity_is_estimated" else 1e-12)
    if case == "both_columns":
        assert np.abs(got["position"] - true["position"]).max() < 1e-9


def read_swing(folder, model, time):
    (folder / "bare.csv").write_text("time_s\n" + "".join(f"{t!r}\n" for t in map(float, time)))
    conditions = {"position0": 0.8, "velocity0": 0.4}
    bare = read_trial(folder / "bare.csv", rig="joint", conditions=conditions, inputs_only=True)
    return simulate(model, bare)


def test_a_joint_needs_a_start(pendulum, monkeypatch, capsys):
    (pendulum / "in.csv").write_text("time_s\n0.0\n0.1\n0.2\n")
    out = pendulum / "out.csv"
    line = fails(monkeypatch, capsys, "predict", pendulum / "model.toml", pendulum / "in.csv", "--out", out)
    assert "position0" in line and not out.exists()


def test_effects_lists_every_cause(monkeypatch, capsys):
    run(monkeypatch, "effects")
    printed = capsys.readouterr().out
    for one in EFFECTS:
        assert f"{one.name} ({one.stage}; " in printed
        for name, info in one.parameters().items():
            assert f"{name} [{info.in_units(ROTARY).unit or '1'}]" in printed


def test_help_is_not_an_error(monkeypatch):
    assert run(monkeypatch, "--help") == 0
    assert run(monkeypatch, "diagnose") == 2


def test_a_joint_that_begins_nowhere_is_told_in_options(tmp_path, monkeypatch, capsys):
    rig = fp.rigs.Joint(constants={"inertia": 0.02, "gravity_cos": 0.1, "gravity_sin": 0.6, "revolute": 1.0})
    save_model(fp.Model(rig), tmp_path / "model.toml")
    (tmp_path / "free.csv").write_text("time_s,effort\n" + "".join(f"{0.01 * k:.2f},0.1\n" for k in range(50)))
    given = ("predict", tmp_path / "model.toml", tmp_path / "free.csv", "--out", tmp_path / "p.csv")
    said = fails(monkeypatch, capsys, *given)
    assert "expected it (its first sample) or --set position0=..." in said
    assert "among the conditions" not in said


WIDE = (
    ("body", "nerves"),
    ("allocate", "left_knee_flexion=-40"),
    ("allocate", "--nerves"),
    ("effects",),
    ("datasets",),
    ("check", str(Path(__file__).parents[2] / "analysis/studies/ankle_demo")),
)


@pytest.mark.parametrize("asked", WIDE)
def test_no_line_is_wider_than_the_terminal(asked, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    assert run(monkeypatch, *asked) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines and all(len(line) <= 80 or len(line.split()) == 1 for line in lines)  # an address is one word
