"""What a reading says across a slack, against the numerical integral and against draws."""

import casadi as ca
import numpy as np
import pytest
from scipy import special, stats

from fes_pin.models.compile.slack import Gaussian, _between, _mills, mixed, normalized


def numbers(low, high):
    """Share, mean and variance of a standard Gaussian between two ends; None is no end."""
    ends = [ca.DM(e) if e is not None else None for e in (low, high)]
    share, mean, spread = (float(v) for v in _between(*ends))
    return np.exp(share), mean, spread


def test_mills_ratio():
    z = np.concatenate([np.linspace(0.0, 40.0, 4001), np.geomspace(40.0, 1e8, 50)])
    exact = np.sqrt(np.pi / 2.0) * special.erfcx(z / np.sqrt(2.0))
    assert np.array(_mills(ca.DM(z))).ravel() == pytest.approx(exact, rel=5e-12)


@pytest.mark.parametrize("low, high", [(-1.0, 2.0), (0.3, 0.5), (2.0, 4.0), (7.0, 9.0), (-3.0, -2.5), (-0.01, 0.01)])
def test_a_gaussian_between_two_ends(low, high):
    share, mean, spread = numbers(low, high)
    exact = stats.truncnorm(low, high)
    assert share == pytest.approx(stats.norm.cdf(high) - stats.norm.cdf(low), rel=1e-9)
    assert mean == pytest.approx(exact.mean(), abs=1e-8)
    assert spread == pytest.approx(exact.var(), rel=1e-4, abs=1e-9)


@pytest.mark.parametrize("end", [-8.0, -1.0, 0.0, 3.0, 4.99, 5.01, 8.0, 20.0, 37.0])
def test_a_gaussian_beyond_an_end(end):
    """Also where the share is 1e-300; either way round."""
    exact = stats.truncnorm(end, np.inf)
    log_share, mean, spread = (float(v) for v in _between(ca.DM(end), None))
    assert log_share == pytest.approx(stats.norm.logsf(end), rel=1e-9)
    assert mean == pytest.approx(exact.mean() if end < 30 else end + 1.0 / end, rel=1e-4)
    assert spread == pytest.approx(1.0 + end * mean - mean**2, abs=1e-6)
    other, below, alike = (float(v) for v in _between(None, ca.DM(-end)))
    assert (other, below, alike) == pytest.approx((log_share, -mean, spread))


def test_far_from_both_ends_the_nearer_one_cuts():
    log_share, mean, _ = (float(v) for v in _between(ca.DM(9.0), ca.DM(30.0)))
    assert log_share == pytest.approx(stats.norm.logsf(9.0), rel=1e-9)
    assert mean == pytest.approx(9.0 + 1.0 / 9.0, rel=2e-3)
    assert float(_between(ca.DM(0.0), ca.DM(0.0))[0]) < -200.0  # nothing lies between


def test_a_cut_takes_along_what_goes_with_the_slack():
    """Against draws of three variables of which one combination is cut."""
    rng = np.random.default_rng(1)
    root = rng.normal(size=(3, 3))
    mean, slack = np.array([0.2, -0.1, 0.4]), np.array([[1.0, 0.5, -1.0]])
    drawn = mean + rng.normal(size=(400_000, 3)) @ root.T
    inside = drawn[np.abs(drawn @ slack[0]) < 0.7]
    whole = Gaussian(ca.DM(mean), ca.DM(root @ root.T))
    share, part = whole.cut(ca.DM(slack), ca.DM(float(slack[0] @ mean)), ca.DM(-0.7), ca.DM(0.7))
    assert np.exp(float(share)) == pytest.approx(len(inside) / len(drawn), rel=0.01)
    assert np.array(part.mean).ravel() == pytest.approx(inside.mean(axis=0), abs=0.02)
    assert np.array(part.covariance) == pytest.approx(np.cov(inside.T), abs=0.03)


def test_parts_that_are_mixed_again_are_the_whole():
    mean, covariance, slack = ca.DM([0.3, 0.1]), ca.DM([[1.0, 0.3], [0.3, 0.5]]), ca.DM([[1.0, -1.0]])
    whole, middle = Gaussian(mean, covariance), ca.DM(0.2)
    cuts = [
        whole.cut(slack, middle, *ends) for ends in ((None, ca.DM(-0.4)), (ca.DM(-0.4), ca.DM(1.0)), (ca.DM(1.0), None))
    ]
    again = mixed(normalized([s for s, _ in cuts]), [one for _, one in cuts])
    assert np.array(again.mean) == pytest.approx(np.array(mean), abs=1e-9)
    assert np.array(again.covariance) == pytest.approx(np.array(covariance), abs=1e-9)
