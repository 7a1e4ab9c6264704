"""Autoregressive noise: orders, whiteness, thinning, and what the white share is for."""

import math

import numpy as np
import pytest
import scipy.signal
import scipy.stats

from fes_pin.infer.levels import WHITE_SHARE
from fes_pin.infer.noise import ORDERS, estimate_noise, first_order_low_pass, noise_step, thin, thinning
from fes_pin.models.autoregression import innovations_of

TRUE = {0: (), 1: (0.6,), 2: (1.2, -0.5), 3: (0.5, -0.3, 0.4)}


def coloured(rng, n, ar=(), ma=()):
    """ARMA noise of unit innovations, without its start."""
    white = rng.standard_normal(n + 500)
    return scipy.signal.lfilter([1.0, *ma], [1.0, *(-a for a in ar)], white)[500:]


def whiteness(residuals, lags=20):
    """p-value of Ljung and Box for several recordings."""
    total = 0.0
    for r in residuals:
        n, centred = len(r), r - r.mean()
        rho = np.array([centred[k:] @ centred[:-k] for k in range(1, lags + 1)]) / (centred @ centred)
        total += n * (n + 2) * float(np.sum(rho**2 / (n - np.arange(1, lags + 1))))
    return scipy.stats.chi2.sf(total, lags * len(residuals))


@pytest.mark.parametrize("order", TRUE, ids=lambda p: f"AR{p}")
def test_orders_are_recovered(order):
    """Never too low. Too high as often as some higher order gains its price by chance, which chi-square tells."""
    runs, wrong = 25, 0
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        noise = estimate_noise([coloured(rng, 800, TRUE[order]) for _ in range(4)])
        assert len(noise.ar) >= order
        wrong += len(noise.ar) > order
        if len(noise.ar) == order:
            assert np.allclose(noise.ar, TRUE[order], atol=5.0 / math.sqrt(3200))
            assert noise.innovation_std == pytest.approx(1.0, rel=0.06)
    chance = sum(scipy.stats.chi2.sf(4.0 * (p - order), p - order) for p in ORDERS if p > order)
    assert wrong <= scipy.stats.binom.ppf(0.999, runs, chance)


@pytest.mark.parametrize("kind", ["white", "ar1", "arma", "process"])
@pytest.mark.parametrize("seed", range(3))
def test_what_is_whitened_is_white(kind, seed):
    rng = np.random.default_rng(seed)
    trials = []
    for _ in range(6):
        if kind == "process":  # random torque through a joint's two lags, under white sensor noise
            slow = scipy.signal.lfilter([1.0], np.polymul([1.0, -0.97], [1.0, -0.9]), rng.standard_normal(1700))[100:]
            trials.append(slow / slow.std() + 0.5 * rng.standard_normal(1600))
        else:
            ar, ma = {"white": ((), ()), "ar1": ((0.8,), ()), "arma": ((0.9,), (-0.5,))}[kind]
            trials.append(coloured(rng, 1600, ar, ma))
    noise = estimate_noise(trials)
    whitened = [innovations_of(r, noise.ar) / noise.innovation_std for r in trials]
    assert whiteness(whitened) > 1e-3
    assert np.concatenate(whitened).std() == pytest.approx(1.0, abs=0.03)
    assert noise.std == pytest.approx(math.sqrt(np.mean(np.square(trials))), rel=1e-3)
    if kind != "white":
        assert whiteness(trials) < 1e-12  # the test can see colour


def test_the_white_share_is_the_least_that_is_left():
    """A residual that the past foretells has innovations all the same: what a model gets wrong is no noise."""
    time = np.arange(1600) * 5e-3
    rng = np.random.default_rng(0)
    trials = [np.sin(2 * math.pi * 1.3 * time + k) + 1e-4 * rng.standard_normal(len(time)) for k in range(4)]
    noise = estimate_noise(trials)
    assert math.sqrt(WHITE_SHARE) * noise.std <= noise.innovation_std < 0.2 * noise.std


def test_samples_taken_by_a_fit_are_counted():
    rng = np.random.default_rng(1)
    residual = rng.standard_normal(100)
    without, using = estimate_noise([residual]), estimate_noise([residual], used=50)
    assert using.std == pytest.approx(without.std * math.sqrt(2.0))


def test_fast_samples_are_averaged():
    values = np.arange(11.0)
    assert np.array_equal(thin(values, 4), [1.5, 5.5])
    assert thin(values, 1) is values
    assert thin(np.ones((9, 2)), 3).shape == (3, 2)
    assert [thinning(dt, 4e-3) for dt in (1e-3, 2e-3, 4e-3, 1e-2)] == [4, 2, 1, 1]
    assert thinning(1e-3, 0.0) == 1


@pytest.mark.parametrize(
    ("steps", "common"), [((1e-3,), 4e-3), ((1e-3, 2e-3), 4e-3), ((5e-3,), 5e-3), ((1e-3, 5e-3), 5e-3)]
)
def test_the_step_of_the_noise(steps, common):
    """About 250 Hz, or the slowest recording's own rate; every recording is brought to it."""
    assert noise_step(steps) == pytest.approx(common)


def test_white_noise_stays_white_and_smaller_when_averaged():
    rng = np.random.default_rng(3)
    fast = rng.standard_normal(8000)
    step = noise_step([1e-3])
    noise = estimate_noise([thin(fast, thinning(1e-3, step))], std=1.0, step_s=step)
    assert noise.innovation_std == pytest.approx(0.5, rel=0.1)
    assert noise.std == 1.0


def test_a_low_pass_is_the_recursion():
    values = np.random.default_rng(0).standard_normal(100)
    np.testing.assert_allclose(
        first_order_low_pass(values, 0.9), scipy.signal.lfilter([0.1], [1.0, -0.9], values), rtol=1e-12
    )


def test_noise_of_what_is_too_short_exact_or_not_finite():
    assert estimate_noise([np.ones(2), np.ones(1)]).ar == ()
    assert estimate_noise([np.zeros(100)]).innovation_std == 1e-12
    with pytest.raises(FloatingPointError, match="not finite"):
        estimate_noise([np.full(100, np.inf)])
