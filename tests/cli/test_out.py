"""What goes out: tables beside a diagnosis, predictions with residuals, the extended joint, pulses."""

import csv

import numpy as np
import pinocchio as pin
import pytest
from cli.test_own import fails, german, recordings, run  # noqa: F401
from cli.test_said_of_recordings import CAUSE
from data import studies
from diagnosis.hidden import study_of

from fes_pin.data.study import read_study, write_study
from fes_pin.data.trial_files import read_trial
from fes_pin.models.catalogue import load_library
from fes_pin.models.store import load_model, save_model


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("out")
    write_study(study_of("joint", ("coulomb_friction",), n_motion=3, duration_s=3.0), folder / "study")
    patch = pytest.MonkeyPatch()
    assert run(patch, "diagnose", folder / "study", "--out", folder / "one", "--tables", "csv") == 0
    patch.undo()
    return folder


def columns(path):
    rows = list(csv.DictReader(path.read_text().splitlines()))
    return {n: np.array([float(r[n] or "nan") for r in rows]) for n in rows[0] if n != "trial"}, [
        r["trial"] for r in rows
    ]


def test_trajectories_hold_every_sample_beside_both_models(made):
    table, trials = columns(made / "one" / "trajectories.csv")
    study = read_study(made / "study")
    assert trials == [t.name for t in study.trials for _ in range(len(t))]
    assert np.array_equal(table["position"], np.concatenate([t["position"] for t in study.trials]))
    assert np.allclose(table["position_residual"], table["position"] - table["position_extended"], rtol=0, atol=1e-15)
    spread = {n: np.std(table["position"] - table[f"position_{n}"]) for n in ("nominal", "extended")}
    assert spread["extended"] < 0.3 * spread["nominal"]


def test_a_prediction_with_residuals_and_as_parquet(made, monkeypatch):
    parquet = pytest.importorskip("pyarrow.parquet")
    study = read_study(made / "study")
    file = made / "study" / "trials" / f"{study.trials[0].name}.csv"
    for out in ("p.csv", "p.parquet"):
        words = ("predict", made / "one" / "model.toml", file, "--out", made / out, "--residuals")
        assert run(monkeypatch, *words) == 0
    one = np.genfromtxt(made / "p.csv", delimiter=",", names=True)
    two = parquet.read_table(made / "p.parquet")
    assert np.array_equal(one["position_residual"], two["position_residual"].to_numpy())
    assert np.allclose(one["position_residual"], study.trials[0]["position"] - one["position"], rtol=0, atol=1e-15)


def test_a_prediction_of_a_file_as_it_was_recorded(made, monkeypatch, capsys, recordings):  # noqa: F811
    assert run(monkeypatch, "new-study", *sorted(recordings.glob("*.csv")), "--rod", 0.4, 1.2) == 0
    model, file = made / "one" / "model.toml", recordings / "m1.csv"
    capsys.readouterr()
    assert "fes-pin new-study" in fails(monkeypatch, capsys, "predict", model, file, "--out", made / "q.csv")
    assert run(monkeypatch, "predict", model, file, "--columns-of", recordings, "--out", made / "q.csv") == 0
    assert len((made / "q.csv").read_text().splitlines()) == 801


def test_the_extended_joint_as_urdf(made, monkeypatch, capsys):
    believed, out = next((made / "study").glob("*.urdf")), made / "extended.urdf"
    words = ("urdf", made / "one" / "model.toml", believed, "--out", out)
    assert run(monkeypatch, *words) == 0
    assert pin.buildModelFromUrdf(str(out)).friction[0] > 0.0
    assert "found one of rig muscle" not in capsys.readouterr().out


def test_a_model_with_a_cause_of_a_library_is_written_as_urdf_with_that_library(made, monkeypatch, capsys, tmp_path):
    library, believed = tmp_path / "own.py", next((made / "study").glob("*.urdf"))
    library.write_text(CAUSE)
    own = load_library(library)
    model = load_model(made / "one" / "model.toml")
    save_model(model + own.effect("own_friction")(torque_nm=0.1), tmp_path / "model.toml")
    words = ("urdf", tmp_path / "model.toml", believed, "--out", tmp_path / "out.urdf")
    assert "own.py; expected --library" in fails(monkeypatch, capsys, *words)
    assert run(monkeypatch, *words, "--library", library) == 0
    assert f"runs the code of {library}" in capsys.readouterr().err and (tmp_path / "out.urdf").exists()


PULSES = ("--max-width", 400, "--max-rate", 50, "--max-charge", 20, "--current", 40)


@pytest.mark.parametrize("more", ["angle_rad", "force_n", "load"])
def test_pulses_of_a_trial_that_an_ankle_was_measured_with(monkeypatch, capsys, tmp_path, more):
    """Its file holds the outputs of its rig as well; its conditions do not matter."""
    names = ["time_s", "pulse_width_us", *([] if more == "load" else [more])]
    rows = "".join(f"{0.01 * k:.2f},300,1.5\n" if len(names) == 3 else f"{0.01 * k:.2f},300\n" for k in range(100))
    (tmp_path / "a.csv").write_text(",".join(names) + "\n" + rows)
    assert run(monkeypatch, "pulses", tmp_path / "a.csv", *PULSES, "--rate", 20, "--out", tmp_path / "p.csv") == 0
    assert "wrote 20 pulses" in capsys.readouterr().out


WRONG_PULSES = {  # columns, options, the option that is named
    "no rate": ("pulse_width_us", (), "--rate"),
    "a width beside widths": ("pulse_width_us", ("--rate", 20, "--width", 200), "--width"),
    "a rate beside pulses": ("stim", ("--rate", 20, "--width", 200), "--rate"),
    "no current": ("stim", ("--width", 200, "--current", 0), "--current"),
    "no limit": ("stim", ("--width", 200, "--max-charge", "inf"), "--max-charge"),
}


@pytest.mark.parametrize("case", WRONG_PULSES)
def test_an_error_of_pulses_names_the_option(monkeypatch, capsys, tmp_path, case):
    column, more, option = WRONG_PULSES[case]
    rows = "".join(
        f"{0.01 * k:.2f},{k % 5 == 0:d}\n" if column == "stim" else f"{0.01 * k:.2f},300\n" for k in range(99)
    )
    (tmp_path / "a.csv").write_text(f"time_s,{column}\n{rows}")
    given = dict(zip(PULSES[::2], PULSES[1::2], strict=True)) | dict(zip(more[::2], more[1::2], strict=True))
    words = [word for pair in given.items() for word in pair]
    said = fails(monkeypatch, capsys, "pulses", tmp_path / "a.csv", *words, "--out", tmp_path / "p.csv")
    assert said.startswith(f"fes-pin: {option}: ")


def test_pulses_of_a_proposed_trial(made, monkeypatch, capsys):
    time = np.arange(500) * 0.002
    path = made / "next_trial.csv"
    path.write_text("time_s,pulse_width_us\n" + "".join(f"{t:.3f},{300 if t > 0.5 else 0}\n" for t in time))
    words = ["pulses", path, "--out", made / "pulses.csv", "--max-rate", 50, "--max-charge", 20, "--current", 40]
    assert run(monkeypatch, *words, "--max-width", 400, "--rate", 20) == 0
    assert "wrote 9 pulses" in capsys.readouterr().out
    listed = np.genfromtxt(made / "pulses.csv", delimiter=",", names=True)
    assert listed["time_s"].tolist() == pytest.approx([0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95])
    (made / "pulses.csv").unlink()
    assert "wider than 200 us" in fails(monkeypatch, capsys, *words, "--max-width", 200, "--rate", 20)
    assert not (made / "pulses.csv").exists()


def test_wrong_tables_are_refused_before_any_work(made, monkeypatch, capsys):
    words = ("diagnose", made / "study", "--out", made / "two", "--tables", "xlsx")
    assert "--tables: expected csv or parquet" in fails(monkeypatch, capsys, *words)
    assert not (made / "two").exists()
    bad = made / "bad.csv"
    bad.write_text(studies.__doc__)
    out = made / "r.csv"
    assert fails(monkeypatch, capsys, "predict", made / "one" / "model.toml", bad, "--out", out)
    assert read_trial(made / "study" / "trials" / "00.csv", rig="joint") and not out.exists()
