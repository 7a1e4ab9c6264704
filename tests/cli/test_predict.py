"""`fes-pin predict`: a trial, standard input, or a study; held to what a check says of the same numbers."""

import csv
import io
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from cli.test_own import fails, run
from diagnosis.hidden import slide, study_of

from fes_pin.data.study import read_study, write_study
from fes_pin.data.table import table_bytes
from fes_pin.data.trial_files import write_trial
from fes_pin.identify.replay import squares_of
from fes_pin.infer.held_out import percent_of_spread
from fes_pin.infer.text import percent
from fes_pin.models.nominal import nominal_model
from fes_pin.models.predict import predict
from fes_pin.models.store import model_toml, save_model


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """An ankle's study on disk, its nominal model, and a file of the inputs of its first trial."""
    folder = tmp_path_factory.mktemp("predict")
    write_study(study_of("ankle", n_motion=2, n_isometric=1, duration_s=4.0), folder / "study")
    study = read_study(folder / "study")
    save_model(nominal_model(study), folder / "model.toml")
    write_trial(study.trials[0].without("angle_rad"), folder / "inputs.csv")
    return folder


def table(path):
    return np.genfromtxt(path, delimiter=",", names=True, dtype=None, encoding="utf-8")


def test_all_trials_of_a_study_are_predicted_under_their_own_conditions(made, monkeypatch, capsys, tmp_path):
    study, model = read_study(made / "study"), nominal_model(read_study(made / "study"))
    for place in (made / "study", made / "study" / "study.toml"):
        assert run(monkeypatch, "predict", made / "model.toml", place, "--out", tmp_path / "p.csv", "--residuals") == 0
        said = capsys.readouterr().out.splitlines()
        assert len(said) == len(study.trials) + 1 and said[-1].startswith("all trials: E ")
        found = table(tmp_path / "p.csv")
        assert found["trial"].tolist() == [int(t.name) for t in study.trials for _ in range(len(t))]
        for trial, line in zip(study.trials, said, strict=False):
            predicted = predict(model, trial)
            rows = found[found["trial"] == int(trial.name)]
            for name, values in predicted.columns.items():
                assert np.allclose(rows[name], values, rtol=0, atol=1e-12)
                assert np.allclose(rows[f"{name}_residual"], trial[name] - values, rtol=0, atol=1e-12)
                error = percent_of_spread(*squares_of(trial, predicted, [name], {}))
            assert line == f"{trial.name}: E {percent(error)}"


def test_the_error_of_all_trials_pools_their_squares_in_units_of_the_noise(monkeypatch, capsys, tmp_path):
    """A position read to a nanometre beside a velocity in m/s: without units of noise the position counts nothing."""
    study, std = slide(3, {}, trials=2), {"position": 1e-9, "velocity": 1e-2}
    good, bad = study.trials
    bad = bad.with_columns(position=bad["position"] * np.linspace(1.0, 3.0, len(bad)))
    study = replace(study, trials=(good, bad), start={"inertia_scale": 1.1, "damping": 0.8})  # as it was simulated
    write_study(study, tmp_path / "study")
    study = read_study(tmp_path / "study")
    model = nominal_model(study)
    (tmp_path / "model.toml").write_text(model_toml(model, {"random": {"white": std, "std": {}, "time": {}}}))

    sums = {}
    for trial in study.trials:
        missed, around = np.zeros(2)
        predicted = predict(model, trial)
        for name, unit in std.items():
            missed += np.sum(((trial[name] - predicted[name]) / unit) ** 2)
            around += np.sum(((trial[name] - np.mean(trial[name])) / unit) ** 2)
        sums[trial.name] = missed, around
    expected = [f"{name}: E {percent(100 * missed / around)}" for name, (missed, around) in sums.items()]
    missed, around = np.sum(list(sums.values()), axis=0)
    expected.append(f"all trials: E {percent(100 * missed / around)}")

    assert run(monkeypatch, "predict", tmp_path / "model.toml", tmp_path / "study") == 0
    assert capsys.readouterr().out.splitlines() == expected
    each = [100 * m / a for m, a in sums.values()]
    assert max(each) > 10 * min(each)


def test_trials_are_chosen_and_excluded_by_name_and_pattern(made, monkeypatch, capsys):
    names = [t.name for t in read_study(made / "study").trials]
    words = ("predict", made / "model.toml", made / "study")
    for more, kept in (
        (("--trials", names[1]), names[1:2]),
        (("--trials", f"{names[0]},{names[1]}"), names[:2]),
        (("--exclude", names[0]), names[1:]),
        (("--trials", "*", "--exclude", f"{names[0]}, {names[2]}"), names[1:2]),
    ):
        assert run(monkeypatch, *words, *more) == 0
        said = capsys.readouterr().out.splitlines()
        assert [line.partition(":")[0] for line in said[: len(kept)]] == kept and len(said) == len(kept) + (
            len(kept) > 1
        )
    assert "--trials: expected trials of" in fails(monkeypatch, capsys, *words, "--trials", "x*")
    assert "--exclude: leaves no trial" in fails(monkeypatch, capsys, *words, "--exclude", "*")


def test_chosen_trials_are_what_other_commands_see(made, monkeypatch, capsys):
    name = read_study(made / "study").trials[0].name
    assert run(monkeypatch, "check", made / "study", "--trials", name) == 0
    assert "one trial: nothing can be held out" in capsys.readouterr().out
    words = ("diagnose", made / "study", "--out", made / "none", "--exclude", "*")
    assert "--exclude: leaves no trial" in fails(monkeypatch, capsys, *words)


def test_standard_input_and_output(made, monkeypatch, capsys, tmp_path):
    trial = read_study(made / "study").trials[0]
    condition = ("--set", f"load_kg={trial.conditions['load_kg']!r}")
    assert (
        run(monkeypatch, "predict", made / "model.toml", made / "inputs.csv", *condition, "--out", tmp_path / "p.csv")
        == 0
    )
    capsys.readouterr()
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO((made / "inputs.csv").read_bytes())))
    assert run(monkeypatch, "predict", made / "model.toml", "-", *condition, "--out", "-") == 0
    assert capsys.readouterr().out == (tmp_path / "p.csv").read_text()
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(b"time_s,pulse_width_us\n0,1\n")))
    said = fails(monkeypatch, capsys, "predict", made / "model.toml", "-", *condition, "--out", "-")
    assert said.startswith("fes-pin: standard input, row ")
    assert not (tmp_path / "-").exists()


def test_a_trial_whose_name_has_a_comma_is_one_cell():
    words = table_bytes({"trial": ["a,b", 'c"'], "x": np.array([1.0, 2.0])}, "a.csv").decode().splitlines()
    assert list(csv.reader(words)) == [["trial", "x"], ["a,b", "1.0"], ['c"', "2.0"]]


def test_without_an_output_there_must_be_something_to_compare_with(made, monkeypatch, capsys):
    words = ("predict", made / "model.toml", made / "inputs.csv", "--set", "load_kg=1")
    assert "to compare with, or --out" in fails(monkeypatch, capsys, *words)


ODD = {  # columns of the file by those of the trial, settings, words
    "pulse widths in ms": (lambda c: {**c, "pulse_width_us": 1e-3 * c["pulse_width_us"]}, ("load_kg=1",), "in ms"),
    "pulse widths in s": (lambda c: {**c, "pulse_width_us": 1e-6 * c["pulse_width_us"]}, ("load_kg=1",), "in s"),
    "times in ms": (lambda c: {**c, "time_s": 1e3 * c["time_s"]}, ("load_kg=1",), "is time_s in ms"),
    "an angle in degrees": (lambda c: c, ("kind=isometric", "angle_rad=190"), "is it in degrees"),
    "a load in g": (lambda c: c, ("load_kg=1000",), "is it in g"),
}


@pytest.mark.parametrize("case", ODD)
def test_what_a_check_refuses_a_prediction_refuses(made, monkeypatch, capsys, tmp_path, case):
    change, settings, words = ODD[case]
    trial = read_study(made / "study").trials[0]
    columns = change({"time_s": trial.time, "pulse_width_us": trial["pulse_width_us"]})
    rows = "".join(f"{t!r},{w!r}\n" for t, w in zip(*(v.tolist() for v in columns.values()), strict=True))
    (tmp_path / "trial.csv").write_text("time_s,pulse_width_us\n" + rows)
    given = [word for setting in settings for word in ("--set", setting)]
    said = fails(
        monkeypatch, capsys, "predict", made / "model.toml", tmp_path / "trial.csv", *given, "--out", tmp_path / "p"
    )
    assert words in said and not (tmp_path / "p").exists()


def test_a_warning_of_a_check_is_a_warning_of_a_prediction(made, monkeypatch, capsys, tmp_path):
    words = ("predict", made / "model.toml", made / "inputs.csv", "--set", "load_kg=150", "--out", tmp_path / "p.csv")
    assert run(monkeypatch, *words) == 0
    assert "odd: load_kg is above 100 kg in trial inputs" in capsys.readouterr().err
    assert run(monkeypatch, *words, "-q") == 0
    assert capsys.readouterr().err == ""


SETTINGS = {  # settings, the option that is named
    "a condition that is missing": ((), "--set load_kg"),
    "no number": (("load_kg=x",), "--set load_kg"),
    "of another kind": (("load_kg=1", "angle_rad=1"), "--set angle_rad"),
    "unknown": (("load_kg=1", "weight=1"), "--set weight"),
    "an angle in degrees": (("kind=isometric", "angle_rad=190"), "--set angle_rad"),
    "a load in g": (("load_kg=1000",), "--set load_kg"),
    "a kind that is none": (("kind=running",), "--set kind"),
}


@pytest.mark.parametrize("case", SETTINGS)
def test_an_error_of_a_condition_names_the_option(made, monkeypatch, capsys, case):
    settings, option = SETTINGS[case]
    given = [f"--set={setting}" for setting in settings]
    said = fails(monkeypatch, capsys, "predict", made / "model.toml", made / "inputs.csv", *given, "--out", "-")
    assert said.startswith(f"fes-pin: {option}: ")


IGNORED = {
    "conditions of a study": (("STUDY", "--set", "load_kg=1"), "--set"),
    "columns of a study": (("STUDY", "--columns-of", "STUDY"), "--columns-of"),
    "trials of a file": (("FILE", "--trials", "a"), "--trials"),
    "trials left out of a file": (("FILE", "--exclude", "a"), "--exclude"),
}


@pytest.mark.parametrize("case", IGNORED)
def test_what_goes_only_with_a_study_or_with_one_trial(made, monkeypatch, capsys, case):
    words, option = IGNORED[case]
    places = {"STUDY": made / "study", "FILE": made / "inputs.csv"}
    words = [places.get(word, word) for word in words]
    said = fails(monkeypatch, capsys, "predict", made / "model.toml", *words, "--out", "-")
    assert said.startswith(f"fes-pin: {option}: goes only with ")


def test_a_study_of_another_rig_is_refused(made, monkeypatch, capsys, tmp_path):
    write_study(study_of("muscle", duration_s=4.0), tmp_path / "muscle")
    said = fails(monkeypatch, capsys, "predict", made / "model.toml", tmp_path / "muscle", "--out", "-")
    assert "expected a study of the rig ankle, found muscle" in said


@pytest.mark.parametrize("end", ["threshold_us", "saturation_us"])
@pytest.mark.parametrize("rig", ["ankle", "muscle"])
def test_a_model_that_lacks_an_end_of_its_recruitment_predicts_no_stimulated_trial(
    monkeypatch, capsys, tmp_path, rig, end
):
    write_study(study_of(rig, duration_s=4.0), tmp_path / "study")
    lines = model_toml(nominal_model(read_study(tmp_path / "study"))).splitlines()
    (tmp_path / "model.toml").write_text("\n".join(line for line in lines if not line.startswith(f"{end} =")))
    said = fails(monkeypatch, capsys, "predict", tmp_path / "model.toml", tmp_path / "study", "--out", "-")
    assert f"the model states no {end}, which trial " in said
