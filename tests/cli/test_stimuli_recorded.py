"""Recordings of stimulators as studies: amplitudes, widths and rates, and logs of events."""

import shutil

import numpy as np
import pytest
from typer.testing import CliRunner

import fes_pin as fp
from fes_pin.cli.main import app
from fes_pin.data.recorded.events import looking_period

HEADERS = ("UnixTimestamp;Microseconds;MilliAmpere;CurrentKG", "t [s];PW [us];I [mA];Force [N]")


def ran(*words):
    result = CliRunner().invoke(app, [*map(str, words)])
    return result.exit_code, result.output


def logged(folder, rng, header, amplitude_varies=True, width_varies=False):
    """A log of a stimulator that looks for changes 20 times a second."""
    n = 600
    on = np.repeat(rng.random(15) < 0.6, 40)
    amplitude = np.where(
        on, np.repeat(np.round(rng.uniform(8.0, 16.0, n // 10), 1), 10) if amplitude_varies else 12.0, 0.0
    )
    width = np.repeat(rng.choice([150.0, 250.0], n // 10), 10) if width_varies else np.full(n, 200.0)
    force, now = np.zeros(n), 0.0
    for k in range(n):
        now += 0.3 * (np.clip((amplitude[k] - 6.0) / 12.0, 0.0, 1.0) - now)
        force[k] = np.round(20.0 * now, 2)
    time = 1.77e9 + 0.05 * np.arange(n)
    rows = [header]
    last = None
    for k in range(n):
        row = f"{width[k]:g};{amplitude[k]:.1f};{force[k]:.2f}"
        if row != last:
            rows.append(f"{time[k]:.3f};{row}")
        last = row
    (folder / "log.csv").write_text("\n".join(rows) + "\n")
    return folder / "log.csv"


@pytest.mark.parametrize("header", HEADERS)
def test_a_log_of_amplitudes_is_a_study_of_amplitudes(header, tmp_path):
    path = logged(tmp_path, np.random.default_rng(1), header)
    names = header.split(";")
    code, said = ran("new-study", path, "--rig", "muscle", "--column", f"time_s={names[0]}:s")
    assert code == 2
    assert "threshold_ma=NUMBER" in said
    assert "threshold_us" not in said
    ends = ("--set", "threshold_ma=6", "--set", "saturation_ma=18")
    code, said = ran("new-study", path, "--rig", "muscle", "--column", f"time_s={names[0]}:s", *ends)
    assert code == 0, said
    said = " ".join(said.split())
    assert "a row only where something changes" in said
    assert "pulse_width_us is 200 us in every pulse and left out" in said
    study = fp.read_study(tmp_path)
    (trial,) = study.trials
    assert set(trial.columns) == {"amplitude_ma", "force_n"}
    assert trial.dt == pytest.approx(0.05, rel=1e-3)
    assert 8.0 < trial["amplitude_ma"].max() < 16.5
    assert trial.time[0] == 0.0


@pytest.mark.parametrize("header", HEADERS)
def test_a_log_of_a_stimulator_and_a_force_is_one_of_a_muscle(header, tmp_path):
    """Nobody said a rig; what a person wanted of the force is no reading of it."""
    path = logged(tmp_path, np.random.default_rng(1), header)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([f"{lines[0]};TargetKG", *(f"{line};9.55" for line in lines[1:])]))
    words = ("--set", "threshold_ma=6", "--set", "saturation_ma=18")
    code, said = ran("new-study", path, *words)
    assert code == 0, said
    assert "the files hold a stimulus and a reading of rig muscle; --rig names another" in said
    assert fp.read_study(tmp_path).rig == "muscle"


def test_a_motor_current_and_a_force_are_no_stimulated_muscle(tmp_path):
    path = tmp_path / "motor.csv"
    path.write_text("t [s];current [mA];force [N]\n" + "\n".join(f"{0.01 * k};{k % 7};{k % 5}" for k in range(99)))
    code, said = ran("new-study", path)
    assert code == 2
    assert "--urdf: expected --urdf FILE" in said


def test_a_log_in_which_both_vary_asks_for_a_threshold_of_the_charge(tmp_path):
    path = logged(tmp_path, np.random.default_rng(2), HEADERS[0], width_varies=True)
    code, said = ran("new-study", path, "--rig", "muscle", "--column", "time_s=UnixTimestamp:s")
    assert code == 2
    assert "threshold_uc=NUMBER (uC)" in said
    words = ("--set", "threshold_uc=1", "--set", "saturation_uc=4", "--column", "time_s=UnixTimestamp:s")
    assert ran("new-study", path, "--rig", "muscle", *words)[0] == 0
    assert set(fp.read_study(tmp_path).trials[0].columns) == {"charge_uc", "force_n"}


def test_a_log_whose_amplitude_is_switched_is_one_of_widths(tmp_path):
    path = logged(tmp_path, np.random.default_rng(3), HEADERS[0], amplitude_varies=False, width_varies=True)
    code, said = ran("new-study", path, "--rig", "muscle", "--column", "time_s=UnixTimestamp:s")
    assert code == 2
    assert "threshold_us=NUMBER" in said


def test_a_sampled_log_of_a_passive_lever_asks_for_no_threshold(tmp_path):
    rng, t = np.random.default_rng(4), 0.01 * np.arange(600)
    angle = 1.7 + 0.2 * np.sin(3.0 * t) + 1e-4 * rng.standard_normal(600)
    rows = [f"{a:.3f},{b:.5f},{0.5 * b:.5f},0" for a, b in zip(t, angle, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(["time_s,angle_rad,torque_nm,pulse_width_us", *rows]) + "\n")
    code, said = ran("new-study", tmp_path / "a.csv", "--rig", "ankle", "--set", "kind=imposed")
    assert code == 2
    assert "threshold" not in said
    assert "foot_mass_kg=NUMBER" in said


def test_a_rows_key_needs_a_rate(tmp_path):
    path = logged(tmp_path, np.random.default_rng(1), HEADERS[0])
    ends = ("--set", "threshold_ma=6", "--set", "saturation_ma=18", "--column", "time_s=UnixTimestamp:s")
    assert ran("new-study", path, "--rig", "muscle", *ends)[0] == 0
    toml = tmp_path / "study.toml"
    toml.write_text("\n".join(line for line in toml.read_text().split("\n") if "resample_hz" not in line))
    with pytest.raises(fp.InputError, match="expected resample_hz as well"):
        fp.read_study(tmp_path)


@pytest.mark.shared
def test_the_amplitude_of_an_events_log_is_the_input(shared, tmp_path):
    shutil.copy(shared / "cases" / "fes_amplitude_events.csv", tmp_path)
    (tmp_path / "fes_amplitude_events.csv").chmod(0o644)
    file = tmp_path / "fes_amplitude_events.csv"
    code, said = ran("new-study", file, "--rig", "muscle")
    assert code == 2
    assert "threshold_ma" in said
    code, said = ran("new-study", file, "--set", "threshold_ma=5", "--set", "saturation_ma=20")
    assert code == 0, said
    assert "force_n          is CurrentKG, in kgf" in said
    (trial,) = fp.read_study(tmp_path).trials
    assert 8.0 <= trial["amplitude_ma"].max() < 20.0
    assert 50.0 < trial["force_n"].max() < 200.0
    assert "pulse_width_us" not in trial


def test_the_period_of_a_log_does_not_depend_on_the_unit_of_its_times():
    rng = np.random.default_rng(0)
    looks = np.cumsum(rng.choice([1, 1, 1, 1, 1, 1, 1, 30], 300))
    values = {"a": np.cumsum(rng.choice([-1.0, 1.0], 300))}
    assert looking_period(0.02 * looks, values) == pytest.approx(0.02)
    assert looking_period(20.0 * looks, values) == pytest.approx(20.0)
