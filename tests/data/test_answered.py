"""What a controller answers is foretold by what it read; noise that its effort was recorded with is not."""

import numpy as np
import pytest

from fes_pin.data.answered import answer_of
from fes_pin.data.log import Log
from fes_pin.data.trial import Trial

DT, FILTER_S = 0.002, 0.008


def controlled(n=4000, seed=0):
    """A reading, and the effort of a controller that averages its rate by a recursion and doubles its gains midway."""
    rng, reading, effort, rate = np.random.default_rng(seed), np.zeros(n), np.zeros(n), 0.0
    wanted = 0.3 * np.sin(2.0 * np.pi * 0.7 * DT * np.arange(n))
    for k in range(1, n):
        pulled = 0.05 * (wanted[k] - reading[k - 1]) + 0.002 * rng.standard_normal()
        reading[k] = np.round((reading[k - 1] + pulled) / 1e-4) * 1e-4
        rate += DT / FILTER_S * ((reading[k] - reading[k - 1]) / DT - rate)
        effort[k] = (20.0 if k < n // 2 else 40.0) * (wanted[k] - reading[k]) - 0.8 * rate
    return effort, reading


def test_noise_is_told_from_what_acted():
    acted, reading = controlled()
    noise = 0.05 * np.random.default_rng(1).standard_normal(len(acted))
    answer = answer_of(acted + noise, [reading])
    assert np.median(answer.left_std) == pytest.approx(0.05, rel=0.05)
    left = answer.quieted(acted + noise, 0.05) - acted
    assert np.sqrt(np.mean(left**2)) < 0.5 * 0.05


def test_an_effort_that_answers_nothing_stays_as_it_is():
    rng = np.random.default_rng(2)
    effort, reading = rng.standard_normal(3000), np.cumsum(rng.standard_normal(3000))
    answer = answer_of(effort, [reading])
    assert np.median(answer.left_std) == pytest.approx(1.0, rel=0.05)
    assert np.abs(answer.quieted(effort, 0.01) - effort).max() < 1e-3


@pytest.mark.parametrize("n", [2, 9, 45, 130])
def test_a_short_one_is_no_error(n):
    acted, reading = (x[:n] for x in controlled())
    answer = answer_of(acted, [reading, np.full(n, np.nan)])
    assert np.isfinite(answer.values).all() and np.isfinite(answer.quieted(acted, 0.1)).all()


def test_missing_and_standing_readings_are_none():
    acted, reading = controlled()
    reading[100:300], reading[1000:1400] = np.nan, reading[1000]
    answer = answer_of(acted, [reading])
    assert np.isfinite(answer.values).all() and np.isfinite(answer.left_std).all()


def test_a_log_takes_noise_out_and_leaves_all_else():
    acted, reading = controlled()
    recorded = acted + 0.05 * np.random.default_rng(3).standard_normal(len(acted))
    trial = Trial("one", "motion", {"effort": recorded, "position": reading}, DT * np.arange(len(acted)))
    quiet = Log(effort_noise=0.05).applied(trial)
    assert np.std(quiet["effort"] - acted) < 0.4 * np.std(recorded - acted)
    assert np.array_equal(quiet["position"], reading)
    driven_by_nothing = trial.without("effort")
    assert Log(effort_noise=0.05).applied(driven_by_nothing) is driven_by_nothing
