"""Noise that lasts: its innovations, what is foretold of it, against the Gaussian of its autocovariances."""

import numpy as np
import pytest
from scipy.linalg import toeplitz

from fes_pin.models.autoregression import beginning, innovations_of, noise_ahead, stationary_variance

KINDS = [(0.8,), (1.2, -0.5), (1.3, -0.8, 0.3, -0.15)]


def covariance(ar, n):
    """Of n samples, from the impulse response."""
    response = np.zeros(4000)
    response[0] = 1.0
    for t in range(1, len(response)):
        response[t] = sum(a * response[t - i] for i, a in enumerate(ar, 1) if t >= i)
    return toeplitz([response[k:] @ response[: len(response) - k] for k in range(n)])


@pytest.mark.parametrize("ar", KINDS)
def test_innovations_and_their_variances_are_those_of_the_gaussian(ar):
    """A Cholesky factor of the covariance tells both: one sample after another, from all before."""
    n = 12
    factor = np.linalg.cholesky(covariance(ar, n))
    x = np.random.default_rng(1).normal(size=(n, 2))
    assert innovations_of(x, ar) == pytest.approx(np.linalg.solve(factor, x), rel=1e-9)
    assert beginning(ar)[1] == pytest.approx(np.diag(factor)[: len(ar)] ** 2, rel=1e-9)
    assert stationary_variance(ar) == pytest.approx(covariance(ar, 1)[0, 0], rel=1e-9)


@pytest.mark.parametrize("ar", KINDS)
def test_what_was_not_seen_is_foretold_from_what_was(ar):
    """Once as many samples as the order were seen, nothing before them tells more."""
    n, order = 14, len(ar)
    seen = np.arange(n) < n - 4
    x = np.random.default_rng(2).normal(size=n)
    told, variances = noise_ahead(x, seen, ar)
    whole = covariance(ar, n)
    for t in range(order, n):
        known = np.flatnonzero(seen & (np.arange(n) < t))
        weights = np.linalg.solve(whole[np.ix_(known, known)], whole[known, t])
        assert told[t] == pytest.approx(weights @ x[known], abs=1e-9)
        assert variances[t] == pytest.approx(whole[t, t] - weights @ whole[known, t], rel=1e-9)


def test_white_noise_is_left_as_it_is():
    x = np.random.default_rng(3).normal(size=20)
    assert innovations_of(x, ()) == pytest.approx(x)
    assert stationary_variance(()) == 1.0
    told, variances = noise_ahead(x, np.ones(20, dtype=bool), ())
    assert not told.any()
    assert variances == pytest.approx(np.ones(20))


def test_the_first_sample_of_noise_that_is_not_stationary_has_no_weight():
    x, ar = np.random.default_rng(3).standard_normal(50), (1.2, -0.1)
    out = innovations_of(x, ar)
    assert out[0] == 0.0
    assert np.isfinite(out).all()
    assert out[2:] == pytest.approx(x[2:] - 1.2 * x[1:-1] + 0.1 * x[:-2])
