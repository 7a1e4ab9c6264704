"""Gains against their spread between units of evidence."""

import numpy as np
import pytest

from fes_pin.infer.problem import Linearized
from fes_pin.infer.spread import ByUnit, Spread, units, usual_spread


def spreads(values, free=4):
    return [Spread(float(v), free) for v in values]


def test_a_spread_that_all_causes_share_stands_behind_each():
    rng = np.random.default_rng(1)
    usual = usual_spread(spreads(2.0 * rng.chisquare(4, 200) / 4.0), 200)
    assert usual.phi == pytest.approx(2.0, rel=0.2)
    assert usual.free > 30.0
    assert Spread(1.0, 4.0).pooled(usual).free == pytest.approx(usual.free + 4.0)
    assert Spread(1.0, 4.0).pooled(usual).phi == pytest.approx(2.0, rel=0.25)


def test_a_spread_of_its_own_stands_alone():
    """Repeats that differ in one thing say nothing of it by what they share."""
    usual = Spread(1.0, 30.0)
    odd = Spread(30.0, 4.0).pooled(usual)
    assert odd.phi == 30.0
    assert odd.free == pytest.approx(4.0, abs=0.1)


def test_spreads_that_differ_stand_behind_little():
    rng = np.random.default_rng(2)
    assert usual_spread(spreads(np.exp(2.0 * rng.standard_normal(200))), 200).free < 2.0


def trials(sizes):
    return [Linearized(np.zeros(n), np.zeros((n, 0)), np.zeros((n, 0))) for n in sizes]


def test_few_trials_are_cut_into_pieces():
    assert units(trials([10] * 6)) == [slice(10 * k, 10 * k + 10) for k in range(6)]
    assert len(units(trials([100, 60]))) == 8


@pytest.mark.parametrize(("scatter", "alarms"), [(0.0, 0.05), (1.0, 0.05)])
def test_p_values_are_those_of_units_that_scatter(scatter, alarms):
    """The mean of eight trials, each with a mean of its own besides: whatever their scatter, one of twenty alarms."""
    rng, parts, low = np.random.default_rng(3), trials([30] * 8), 0
    for _ in range(1000):
        y = np.repeat(scatter * rng.standard_normal(8), 30) + rng.standard_normal(240)
        moved = np.full(240, y.mean())
        spread = ByUnit.of(moved, y - moved, parts).clustered()
        low += spread.p_value(float(moved @ moved), 1) < 0.05
    assert low / 1000 == pytest.approx(alarms, abs=0.021)


def test_a_part_of_the_residual_that_all_units_share_is_no_spread():
    """A cause changes the gains of a filter too: the residual at the maximum is then not orthogonal to its effect."""
    rng, parts = np.random.default_rng(4), trials([30] * 8)
    moved = np.repeat([0.0, 5.0, 0.1, 0.2, 1.0, 2.0, 0.0, 0.4], 30)
    y = rng.standard_normal(240)
    left = y - moved * (moved @ y) / (moved @ moved)
    apart, shared = (ByUnit.of(moved, r, parts).clustered() for r in (left, left - 0.1 * moved))
    assert shared.phi == pytest.approx(apart.phi, rel=1e-9)
    assert shared.free == apart.free
