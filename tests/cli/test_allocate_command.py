"""`fes-pin allocate` through typer."""

import pytest
import typer
from typer.testing import CliRunner

from fes_pin.body.measured_walk import data_folder
from fes_pin.cli import allocate as allocate_command
from fes_pin.data.errors import InputError


def run(*words):
    app = typer.Typer()
    app.command()(allocate_command.allocate)
    return CliRunner().invoke(app, list(words))


def test_a_torque_becomes_a_pulse_width_and_a_reason():
    result = run("left_ankle_dorsiflexion=-400", "--nerve", "left_tibial", "--angle", "left_knee_flexion=20")
    assert result.exit_code == 0
    assert "left tibial 1000 us" in result.output and "left tibial saturated" in result.output


def test_threshold_and_saturation_are_kept():
    words = ("left_ankle_dorsiflexion=-40", "--nerve", "left_tibial", "--threshold-us", "90", "--saturation-us", "91")
    assert any(f"left tibial {w} us" in run(*words).output for w in (90, 91))


def test_nerves_are_listed():
    assert "left_femoral" in run("--nerves").output


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("left_knee_flexion",),
        ("left_knee_flexion=much",),
        ("toe=1",),
        ("--walk", "nowhere"),
        ("--walk", "nowhere", "--passive", "-1"),
        ("left_knee_flexion=-40", "--angle", "left_knee_flexion=900"),
        ("left_knee_flexion=-40", "--angle", "left_knee=10"),
        ("--nerve", "x", "toe=1"),
    ],
)
def test_bad_input_is_an_input_error(words):
    result = run(*words)
    assert isinstance(result.exception, InputError)


@pytest.mark.shared
def test_the_walk_is_tabled():
    try:
        folder = data_folder()
    except InputError:
        pytest.skip("the measured walk is not here")
    result = run("--walk", str(folder))
    assert result.exit_code == 0 and "right_knee_flexion" in result.output and "157 samples" in result.output
