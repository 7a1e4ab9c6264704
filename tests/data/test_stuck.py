"""Stretches of a stuck sensor are found; a rig that rests, a coarse encoder and a stimulus that waits are none."""

import numpy as np
import pytest

from fes_pin.data.stuck import FEW, stuck, without_stuck
from fes_pin.data.trial import Trial

DT = 2e-3
TIME = np.arange(4000) * DT
SWING = 0.4 * np.sin(3.0 * TIME) * np.cos(0.7 * TIME)


def noisy(seed, digit=0.0):
    reading = SWING + 1e-3 * np.random.default_rng(seed).standard_normal(len(TIME))
    return np.round(reading / digit) * digit if digit else reading


def held(values, begin, end):
    out = np.array(values)
    out[begin:end] = out[begin]
    return out


def sliding(v0=0.5, brake=0.4):
    """A slide that dry friction brings to rest: exact, or with the digits of a file."""
    t = np.minimum(TIME, v0 / brake)
    return v0 * t - 0.5 * brake * t**2


@pytest.mark.parametrize("digit", [0.0, 1e-5, 8e-4])
@pytest.mark.parametrize(("begin", "end"), [(2000, 4000), (1700, 1790), (0, 500)])
def test_noise_that_stops_is_the_sensors(begin, end, digit):
    values = held(noisy(3, digit), begin, end)
    (found,) = stuck(values)
    assert abs(found.start - begin) < 4 and abs(found.stop - end) < 4  # neighbours may be equal by chance


def test_a_reading_without_noise_that_stops_in_full_motion_is_the_sensors():
    (found,) = stuck(held(SWING, 1900, 2300))
    assert (found.start, found.stop) == (1900, 2300)


def slack(values, half):
    """What follows a value with play: it stands wherever the value turns."""
    out = np.zeros_like(values)
    for k in range(1, len(values)):
        out[k] = np.clip(out[k - 1], values[k] - half, values[k] + half)
    return out


RESTING = {
    "brought to rest": sliding(),
    "brought to rest, as a file has it": np.round(sliding(), 6),
    "a coarse encoder": np.round(SWING / 0.01) * 0.01,
    "a coarse encoder that rests": np.round(sliding() / 2e-3) * 2e-3,
    "a coarse encoder, resampled": np.interp(TIME, TIME[::3], np.round(sliding() / 2e-3)[::3] * 2e-3),
    "a noisy encoder that rests": np.round((sliding() + 3e-4 * np.random.default_rng(5).standard_normal(4000)) / 2e-3),
    "pulses from rest": np.where(TIME % 1.0 < 0.5, 0.0, np.sin(4.0 * np.pi * (TIME % 1.0)) ** 2),
    "never moves": np.zeros(4000),
    "play": slack(SWING, 0.1),
    "noise alone": noisy(1),
}


@pytest.mark.parametrize("name", RESTING)
def test_what_rests_is_no_stuck_sensor(name):
    assert stuck(RESTING[name]) == []


def trial(position, **columns):
    return Trial("one", "motion", {"position": position, "effort": np.ones(len(position)), **columns}, TIME)


def test_a_trial_goes_on_behind_the_stretch_where_a_model_may_begin_anywhere():
    whole = trial(held(noisy(2), 1500, 1600))
    pieces, said = without_stuck(whole, ("position",), True)
    assert [p.name for p in pieces] == ["one", "one_part2"]
    assert sum(map(len, pieces)) == pytest.approx(3900, abs=4)
    assert pieces[1].time[0] == pytest.approx(TIME[1600], abs=3 * DT)
    assert len(said) == 1 and "position stays at" in said[0] and "from 3 s on in trial one" in said[0]
    only, _ = without_stuck(whole, ("position",), False)
    assert [len(p) for p in only] == [len(pieces[0])]


def test_where_a_trial_began_says_nothing_of_its_later_pieces():
    whole = Trial("one", "motion", {"position": held(noisy(2), 1500, 1600)}, TIME, {"position0": 0.0, "load_kg": 2.0})
    first, second = without_stuck(whole, ("position",), True)[0]
    assert dict(first.conditions) == {"position0": 0.0, "load_kg": 2.0}
    assert dict(second.conditions) == {"load_kg": 2.0}


def test_short_pieces_are_not_worth_a_start_and_a_trial_may_be_lost_whole():
    pieces, _ = without_stuck(trial(held(noisy(2), 500, 900)), ("position",), True)
    assert [len(p) > FEW for p in pieces] == [True]
    lost, said = without_stuck(trial(held(noisy(2), 5, 500)), ("position",), False)
    assert lost == [] and "are left out" in said[0]


def test_at_rest_from_the_beginning_is_a_rig_that_begins_at_rest():
    whole = trial(held(noisy(2), 0, 500))
    assert without_stuck(whole, ("position",), False) == ([whole], [])
    assert without_stuck(trial(noisy(2)), ("position", "velocity"), True)[1] == []
