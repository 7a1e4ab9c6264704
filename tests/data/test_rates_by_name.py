"""A name that ends in `dot` is of a rate; of two columns of times that which rises is taken; of rest all is said."""

import numpy as np
import pytest

import fes_pin as fp
from fes_pin.data.errors import InputError
from fes_pin.data.new_recording import propose
from fes_pin.data.new_study import new_study
from fes_pin.data.schema import known_rigs
from fes_pin.data.templates import pendulum
from fes_pin.data.wanted import Wanted

RIG = known_rigs()["joint"]
TIME = 0.01 * np.arange(400)


def swing(seed, rests=0.0):
    """A swing that dies out at an angle, and its rate."""
    rng = np.random.default_rng(seed)
    falls, turns = rng.uniform(1.5, 2.5), rng.uniform(4.0, 7.0)
    angle = np.exp(-falls * TIME) * np.cos(turns * TIME)
    return rests + angle, np.gradient(angle, TIME)


def table(path, **columns):
    np.savetxt(path, np.column_stack([*columns.values()]), delimiter=",", header=",".join(columns), comments="")
    return path


def made(folder, file, **columns):
    (folder / "rod.urdf").write_text(pendulum(0.3, 0.5))
    start = {"inertia_scale": 1.0, "damping": 0.01}
    wanted = Wanted((file,), RIG, folder, "own", urdf=folder / "rod.urdf", columns=columns)
    return new_study(wanted, lambda *_: start)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("angle", "rate"),
    [
        ("theta", "theta_dot"),
        ("theta1", "theta1_dot"),
        ("theta1", "thetadot1"),
        ("jointAngle", "jointAngleDot"),
        ("phi", "phidot"),
    ],
)
def test_what_ends_in_dot_is_the_velocity_and_not_the_position(tmp_path, seed, angle, rate):
    q, v = swing(seed)
    found = propose(table(tmp_path / "a.csv", t=TIME, **{rate: v, angle: q}), RIG, True).candidates
    assert found["position"] == (angle,) and found["velocity"] == (rate,)


@pytest.mark.parametrize("name", ["theta_ddot", "qddot", "anecdote", "dot", "force_dot"])
def test_an_acceleration_and_what_has_no_angle_are_no_velocity(tmp_path, name):
    q, v = swing(4)
    found = propose(table(tmp_path / "a.csv", t=TIME, theta=q, **{name: v}), RIG, True).candidates
    assert found["position"] == ("theta",) and not found["velocity"]


@pytest.mark.parametrize("digits", ["%.6g", "%.0f"])
def test_of_two_columns_of_times_that_which_rises_is_taken(tmp_path, digits):
    begin = float(digits % 1.71818e9)
    both = {"time": begin + 0.0 * TIME, "elapsed_time": TIME}
    path = table(tmp_path / "a.csv", **both, theta=swing(5)[0])
    assert propose(path, RIG, True).candidates["time_s"] == ("elapsed_time",)
    path = table(tmp_path / "b.csv", time=begin + TIME, elapsed_time=TIME, theta=swing(5)[0])
    with pytest.raises(InputError, match=r"time_s=NAME:UNIT \(time or elapsed_time"):
        made(tmp_path, path)


def test_of_a_clock_that_stands_and_is_alone_the_name_is_kept(tmp_path):
    path = table(tmp_path / "a.csv", time=0.0 * TIME, theta=swing(6)[0])
    assert propose(path, RIG, True).candidates["time_s"] == ("time",)


@pytest.mark.parametrize("rests", [-1.2, 0.9])
def test_of_rest_off_hanging_a_torque_is_named_beside_the_zero(tmp_path, rests):
    study = made(tmp_path, table(tmp_path / "a.csv", time_s=TIME, position=swing(7, rests)[0]))
    (tmp_path / "study.toml").write_text(study.contents["study.toml"])
    odd = " ".join(fp.check(fp.read_study(tmp_path)).odd)
    assert "position comes to rest at" in odd and "or does a torque hold it?" in odd
