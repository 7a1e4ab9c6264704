"""Error rates of the family of tests."""

import numpy as np
import pytest
import scipy.stats

from fes_pin.infer.family import Family, SimulatedFamily


@pytest.mark.parametrize("correlation", [0.0, 0.6, 0.95])
def test_the_family_wise_error_is_what_it_says(correlation):
    """Under the null the smallest of 40 correlated tests, of one and two degrees, is below 5 % in 5 % of studies."""
    rng = np.random.default_rng(0)
    count, runs = 60, 4000
    gram = (1.0 - correlation) * np.eye(count) + correlation
    gram *= np.outer(scale := rng.uniform(0.1, 10.0, count), scale)
    blocks = [slice(k, k + 1) for k in range(20)] + [slice(20 + 2 * k, 22 + 2 * k) for k in range(20)]
    family = Family(gram, blocks, seed=1)
    draws = rng.standard_normal((runs, count)) @ np.linalg.cholesky(gram).T
    smallest = np.ones(runs)
    for block in blocks:
        part = draws[:, block]
        gains = np.einsum("ni,ni->n", part @ np.linalg.inv(gram[block, block]), part)
        smallest = np.minimum(smallest, scipy.stats.chi2.sf(gains, block.stop - block.start))
    false = sum(family.adjusted(p) < 0.05 for p in smallest)
    low, high = scipy.stats.binom.interval(0.999, runs, 0.05)
    spread = 3.3 * 0.07 * 0.05 * runs  # of the critical value itself, which 4000 draws give to 7 %
    assert low - spread <= false <= high + spread
    assert 1.0 <= family.tests <= len(blocks) * (1.0 + 3.3 * 0.07)


def test_one_test_alone_keeps_its_p_value():
    family = Family(np.array([[4.0]]), [slice(0, 1)], seed=0)
    assert family.tests == pytest.approx(1.0, abs=0.25)
    assert family.p_value(0.0, 1) == pytest.approx(1.0)
    assert family.p_value(40.0, 1) < 1e-8


def test_a_family_that_is_simulated_alarms_at_its_level():
    """Of 100 gains whose largest is known from as many simulations; its law is a Gumbel distribution's, nearly."""
    rng = np.random.default_rng(3)
    largest = rng.chisquare(1, size=(300, 200, 100)).max(axis=2)  # 300 families, 100 draws of each, and 100 of data
    families = [SimulatedFamily(own) for own in largest[:, :100]]
    p_values = np.array([[f.p_value(g) for g in own] for f, own in zip(families, largest[:, 100:], strict=True)])
    for level in (0.2, 0.05, 0.01):
        assert 0.7 * level < np.mean(p_values < level) < 1.4 * level
    assert families[0].p_value(0.0) == families[0].p_value(-3.0) == 1.0
    assert 0.0 < families[0].p_value(1e9) < 1e-12
