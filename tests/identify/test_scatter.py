"""Gains beside errors that are no white noise: as far as the scores of pieces of the data agree on them."""

from types import SimpleNamespace

import numpy as np
import pytest

from fes_pin.identify.distributions import chi2_quantile
from fes_pin.identify.problem import Linearized
from fes_pin.identify.scatter import excess_scatter

EACH, TRIALS, DRAWS = 500, 4, 200


def fitted(columns, errors, names):
    """What least squares under white noise of deviation 1 leaves, as far as `excess_scatter` looks at it."""
    left = errors - columns @ np.linalg.lstsq(columns, errors, rcond=None)[0]
    cuts = np.split(np.arange(len(errors)), TRIALS)
    parts = [Linearized(left[c], columns[c], np.zeros((len(c), 0)), 0.0) for c in cuts]
    return SimpleNamespace(parts=parts, free=names, at_bound=(), sse=float(left @ left))


def gains(coefficient, seed):
    """Gains of two slow waves that are not there beside a level, and the same over their scatter; noise lasts."""
    rng, n = np.random.default_rng(seed), EACH * TRIALS
    time = np.arange(n) / n
    columns = np.stack([np.ones(n), *(np.sin(2.0 * np.pi * k * time) for k in (3.0, 7.0))], axis=1)
    out = []
    for _ in range(DRAWS):
        errors = np.zeros(n)
        for k, shock in enumerate(np.sqrt(1.0 - coefficient**2) * rng.normal(size=n)):
            errors[k] = coefficient * errors[k - 1] + shock
        small, large = fitted(columns[:, :1], errors, ("a",)), fitted(columns, errors, ("a", "b", "c"))
        gain = small.sse - large.sse
        out.append((gain, gain / excess_scatter(large, small)))
    return np.array(out)


def test_beside_white_noise_a_gain_stays_what_it_is_but_for_chance():
    plain, scaled = gains(0.0, 0).T
    assert (scaled <= plain).all()
    assert np.mean(scaled / plain) > 0.85
    assert np.mean(plain > chi2_quantile(0.95, 2)) == pytest.approx(0.05, abs=0.04)


def test_beside_noise_that_lasts_it_keeps_its_level_as_the_plain_gain_does_not():
    plain, scaled = gains(0.8, 1).T
    assert np.mean(plain > chi2_quantile(0.95, 2)) > 0.5
    assert np.mean(scaled > chi2_quantile(0.95, 2)) < 0.12


def test_what_is_there_in_all_pieces_keeps_its_gain():
    rng, n = np.random.default_rng(2), EACH * TRIALS
    wave = np.sin(40.0 * np.pi * np.arange(n) / n)
    columns = np.stack([np.ones(n), wave], axis=1)
    errors = 0.5 * wave + rng.normal(size=n)
    small, large = fitted(columns[:, :1], errors, ("a",)), fitted(columns, errors, ("a", "b"))
    assert excess_scatter(large, small) < 1.6


def test_nothing_more_scatters_nothing():
    one = fitted(np.ones((EACH * TRIALS, 1)), np.random.default_rng(3).normal(size=EACH * TRIALS), ("a",))
    assert excess_scatter(one, one) == 1.0
