"""Errors one sample ahead and over a horizon: of autoregressive noise beside theory, and from a saved model."""

import numpy as np
import pytest
import scipy.signal

from fes_pin.identify.ahead import forecast
from fes_pin.infer.noise import Noise

AR = (1.5, -0.7)
DT = 0.01


def noise(count: int = 60_000) -> np.ndarray:
    return scipy.signal.lfilter([1.0], [1.0, *(-a for a in AR)], np.random.default_rng(5).standard_normal(count))


@pytest.mark.parametrize("steps", [1, 2, 7, 30])
def test_what_is_missed_has_the_variance_of_theory(steps):
    """An error k steps ahead has the variance of the first k terms of the noise's impulse response."""
    e = noise()
    missed = e - forecast(e, Noise(1.0, AR), DT, steps * DT)
    response = scipy.signal.lfilter([1.0], [1.0, *(-a for a in AR)], np.eye(1, steps)[0])
    assert np.var(missed[100:]) == pytest.approx(np.sum(response**2), rel=0.05)


@pytest.mark.parametrize("cut", [200, 201, 202])
@pytest.mark.parametrize("every", [1, 3])
@pytest.mark.parametrize("steps", [6, 7])
def test_nothing_later_than_the_horizon_is_used(steps, every, cut):
    """Also where the noise is known at a longer step than the samples'."""
    e = noise(400)
    other = np.where(np.arange(400) < cut, e, 1e3)
    before, after = (forecast(x, Noise(1.0, AR, 1.0, every * DT), DT, steps * DT) for x in (e, other))
    rows = slice(0, cut + steps)
    assert np.array_equal(before[rows], after[rows])
    assert not np.array_equal(before[: cut + steps + 2 * every], after[: cut + steps + 2 * every])


def test_white_noise_foretells_nothing():
    assert not forecast(noise(100), Noise(1.0), DT, 0.1).any()


def test_noise_that_is_known_at_a_longer_step_foretells_by_it():
    """Averages of three samples are foretold from averages that were over before."""
    e = np.repeat(noise(300), 3)
    predicted = forecast(np.append(e, 0.5), Noise(1.0, AR, 1.0, 3 * DT), DT, 0.0)
    assert predicted[:-1:3] == pytest.approx(forecast(noise(300), Noise(1.0, AR), 3 * DT, 0.0))
    assert len(predicted) == 901


def test_a_trial_shorter_than_a_step_is_foretold_by_nothing():
    assert not forecast(np.ones(2), Noise(1.0, AR, 1.0, 3 * DT), DT, 0.0).any()
