"""Rigs of no form in the library: what they hide acts as it says, and their nulls are those of the laboratory."""

import numpy as np
import pytest
from driven_rigs import laboratory
from driven_rigs.draw import BASES
from driven_rigs.laboratory import Bench, draw_laboratory
from driven_rigs.no_form import CAUSES, NEAREST, NoForm, draw_no_form

from fes_pin.data.study import read_study
from fes_pin.diagnosis.by_trial import ZERO
from fes_pin.models.catalogue import shipped

SEED = 1600003
"""Of any rig."""
SIZE = 0.2
"""Torque of what is hidden, N m."""
ARM, DT = BASES[1], 0.002


WANTED = 0.5 * np.sin(2.0 * np.pi * np.arange(1000) * DT)[:, None] * np.ones(2)


def bench(kind, cause="", noise=0.0, **known):
    """Return a bench that moves an arm to and fro once a second in two trials, and hides something."""
    made = kind(ARM, DT, "integral", WANTED, 0.0, noise=noise)
    made.hidden = made.numbers((cause,), SIZE, WANTED, np.random.default_rng(2)) | known if cause else {}
    return made


@pytest.fixture(scope="module")
def plain():
    """Efforts and positions without anything hidden."""
    return bench(NoForm).run(np.random.default_rng(1))


def test_causes_are_of_the_library():
    library = {one.name for one in shipped().effects} | {ZERO}
    assert all({*nearest, *others} <= library for nearest, others in NEAREST.values())


@pytest.mark.parametrize("cause", CAUSES)
def test_what_is_hidden_changes_the_command(cause, plain):
    other = bench(NoForm, cause, noise=1e-4).run(np.random.default_rng(1))[0]
    assert np.abs(plain[0] - other).max() > 0.02 * SIZE


def test_without_a_cause_both_integrators_move_the_rig_alike(plain):
    assert bench(Bench).run(np.random.default_rng(1))[1] == pytest.approx(plain[1], abs=1e-6)
    assert np.ptp(plain[1]) > 0.5


def test_friction_differs_by_direction_as_much_as_stated():
    made = bench(NoForm, "friction_by_direction", uneven=0.4)
    ahead, back = (made._friction(np.zeros(2), np.full(2, v)) for v in (5.0, -5.0))
    assert ahead == pytest.approx(1.4 * SIZE) and back == pytest.approx(-0.6 * SIZE)


def test_friction_falls_with_the_time_of_all_trials():
    made = bench(NoForm, "warming", falls=0.5, warms_s=4.0)
    made.acts(2000, np.zeros(2), np.random.default_rng(1))
    first, second = made._friction(np.zeros(2), np.full(2, 5.0))
    assert first == pytest.approx(SIZE * (0.5 + 0.5 * np.exp(-1.0)))
    assert second == pytest.approx(SIZE * (0.5 + 0.5 * np.exp(-1.5)))


@pytest.mark.parametrize("cause", ["bristles", "hysteretic_spring"])
def test_a_cycle_takes_energy_out_of_what_has_a_memory(cause):
    made, work = bench(NoForm, cause, rest=0.0, stiction=0.0, way=0.005), 0.0
    state, h = np.zeros((3, 2)), 1e-3
    for k in range(2000):  # two turns along a sine; the first one begins at rest
        state[0], state[1] = 0.5 * np.sin(2.0 * np.pi * k * h), np.pi * np.cos(2.0 * np.pi * k * h)
        torque, bends = made._hides(np.zeros(2), *state)
        state[2] = state[2] + h * bends
        work += h * float((torque * state[1])[0]) if k >= 1000 else 0.0
    way = 4.0 * 0.5
    assert -1.2 * SIZE * way < work < -0.1 * SIZE * way


def test_a_command_that_is_lost_is_held():
    made, rng = bench(NoForm, "lost_packets", lost=0.3), np.random.default_rng(3)
    acted = np.array([made.acts(k, np.full(2, float(k)), rng) for k in range(2000)])
    late = np.arange(2000)[:, None] - acted
    assert set(np.unique(late[acted[:, 0] != np.arange(2000)])) >= {1.0, 2.0}
    assert np.mean(late > 0.0) == pytest.approx(0.3, abs=0.04)


def test_steps_of_a_current_and_noise_in_bursts():
    rng = np.random.default_rng(3)
    made = bench(NoForm, "quantised_current", step=0.5)
    assert made.acts(1, np.array([0.74, -0.76]), rng) == pytest.approx([0.5, -1.0])
    noisy = bench(NoForm, "bursts", louder=20.0, often_s=1.0)
    noisy.noise = 1e-3
    read = np.array([noisy.reads(k, np.zeros(2), rng) for k in range(5000)])
    assert np.abs(read).max() > 10e-3 and np.median(np.abs(read)) < 1.5e-3


def test_a_seed_makes_the_same_study_again_and_says_what_is_nearest(tmp_path, monkeypatch):
    monkeypatch.setattr(laboratory, "LONGEST_S", 8.0)
    one, other = (draw_no_form(("ripple",), SEED, tmp_path / n) for n in "ab")
    assert one.nearest == ("cogging",) and draw_laboratory((), SEED, tmp_path / "c").nearest is None
    pairs = zip(read_study(one.study).trials, read_study(other.study).trials, strict=True)
    assert all(np.array_equal(a["effort"], b["effort"]) for a, b in pairs)
