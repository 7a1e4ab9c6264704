"""`fes-pin verify`: a model on trials that it explains, or does not; exit codes 0, 1 and 2."""

import json
from dataclasses import replace

import pytest
from cli.test_own import fails, run
from diagnosis.hidden import study_of

import fes_pin as fp
from fes_pin.data.log import Log
from fes_pin.identify.stored import load_range, stored_tables
from fes_pin.models.store import model_toml


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The model that was fitted to half the trials of an ankle; the other half, and the same with less force."""
    folder = tmp_path_factory.mktemp("verify")
    study = study_of("ankle", n_motion=6, n_isometric=2, duration_s=4.0)
    fitted = fp.fit(fp.nominal_model(study), study.trials[::2])
    (folder / "model.toml").write_text(model_toml(fitted.model, stored_tables(fitted, Log())))
    fp.save_model(fitted.model, folder / "bare.toml")
    new = study.trials[1::2]
    fp.write_study(replace(study, trials=new), folder / "same")
    weaker = [t.with_columns(force_n=0.9 * t["force_n"]) if "force_n" in t else t for t in new]
    fp.write_study(replace(study, trials=tuple(weaker)), folder / "weaker")
    return folder


def test_new_trials_of_the_same_rig_are_explained(made, monkeypatch, capsys):
    assert run(monkeypatch, "verify", made / "same", made / "model.toml") == 0
    said = capsys.readouterr().out
    assert "explains the trials within its noise (p = " in " ".join(said.split())
    rows = [line.split()[0] for line in said.partition("trial  ")[2].splitlines()[1:]]
    assert rows == [trial.name for trial in fp.read_study(made / "same").trials]


def test_errors_over_the_horizon_do_not_count_the_time_before_it(made, monkeypatch, capsys):
    """Predictions from before the first readings made E of a right model ten times that of its free simulation."""
    assert run(monkeypatch, "verify", made / "same", made / "model.toml", "--json") == 0
    for one in json.loads(capsys.readouterr().out)["trials"].values():
        assert one["error_percent"]["horizon"] < 3.0 * one["error_percent"]["free"]


def test_trials_of_a_weaker_muscle_are_not(made, monkeypatch, capsys):
    assert run(monkeypatch, "verify", made / "weaker", made / "model.toml", "--json", "--horizon", "0.2") == 1
    found = json.loads(capsys.readouterr().out)
    assert set(found) == {"study", "model", "horizon_s", "trials", "remainder"}
    assert found["horizon_s"] == 0.2 and found["model"] == ["ankle"]
    assert found["remainder"]["p_value"] < 0.01
    for name, one in found["trials"].items():
        trial = fp.read_study(made / "weaker").trial(name)
        predicted = fp.predict(fp.load_model(made / "model.toml"), trial)
        (column,) = predicted.columns.keys() & {"angle_rad", "force_n"}
        missed, around = trial.residual(predicted, column), trial[column] - trial[column].mean()
        assert one["error_percent"]["free"] == pytest.approx(100 * (missed @ missed) / (around @ around), rel=0.02)


def test_columns_beyond_the_range_of_the_fitted_trials_are_named(made, monkeypatch, capsys, tmp_path):
    ranges = load_range(made / "model.toml")
    trials = fp.read_study(made / "same").trials
    text = (made / "model.toml").read_text()
    low, high = ranges["pulse_width_us"]
    assert low <= min(t["pulse_width_us"].min() for t in trials) and high > 0.0
    (tmp_path / "model.toml").write_text(text.replace(f"    {high!r},", f"    {0.5 * high!r},"))
    run(monkeypatch, "verify", made / "same", tmp_path / "model.toml", "--json")
    beyond = [one["outside"] for one in json.loads(capsys.readouterr().out)["trials"].values()]
    assert any("pulse_width_us" in one for one in beyond)


def test_bad_input_is_one_line(made, monkeypatch, capsys, tmp_path):
    assert "expected a table [random]" in fails(monkeypatch, capsys, "verify", made / "same", made / "bare.toml")
    assert "none.toml" in fails(monkeypatch, capsys, "verify", made / "same", tmp_path / "none.toml")
    assert "none" in fails(monkeypatch, capsys, "verify", tmp_path / "none", made / "model.toml")
    fp.write_study(study_of("muscle"), tmp_path / "muscle")
    line = fails(monkeypatch, capsys, "verify", tmp_path / "muscle", made / "model.toml")
    assert "expected a study of the rig ankle, found muscle" in line
