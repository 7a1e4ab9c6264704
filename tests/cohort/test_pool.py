"""Pooled values against statsmodels' on a published set of trials, and rates by their definition."""

import math

import numpy as np
import pytest

from fes_pin.cohort.pool import discovery_rates, pooled, share_interval
from fes_pin.cohort.tables import prevalence_rows

# Colditz et al., Efficacy of BCG vaccine in the prevention of tuberculosis, JAMA 271 (1994): cases and others, treated
# and not. What is expected is of statsmodels 0.14.5: combine_effects(y, v, method_re="iterated", use_t=True).
TREATED = [(4, 119), (6, 300), (3, 228), (62, 13536), (33, 5036), (180, 1361), (8, 2537), (505, 87886), (29, 7470),
           (17, 1699), (186, 50448), (5, 2493), (27, 16886)]  # fmt: skip
CONTROLS = [(11, 128), (29, 274), (11, 209), (248, 12619), (47, 5761), (372, 1079), (10, 619), (499, 87892), (45, 7232),
            (65, 1600), (141, 27197), (3, 2338), (29, 17825)]  # fmt: skip


def vaccine():
    both = list(zip(TREATED, CONTROLS, strict=True))
    y = [math.log((a / (a + b)) / (c / (c + d))) for (a, b), (c, d) in both]
    v = [1 / a - 1 / (a + b) + 1 / c - 1 / (c + d) for (a, b), (c, d) in both]
    return y, np.sqrt(v)


def test_published_trials_are_pooled_as_statsmodels_does():
    found = pooled(*vaccine())
    assert found["between"] ** 2 == pytest.approx(0.3180684522, rel=1e-6)
    assert found["mean"] == pytest.approx(-0.714968, abs=1e-6)
    assert (found["low"], found["high"]) == pytest.approx((-1.109098, -0.320838), abs=2e-6)
    assert found["heterogeneity"] == pytest.approx(92.11734685, rel=1e-8)
    assert found["p_alike"] < 1e-20 and found["next_low"] < found["low"]


def test_the_answer_is_free_of_units():
    y, s = vaccine()
    small, usual = pooled([1e-9 * v for v in y], 1e-9 * s), pooled(y, s)
    assert small["mean"] == pytest.approx(1e-9 * usual["mean"]) and small["between"] == pytest.approx(
        1e-9 * usual["between"]
    )


def test_studies_that_agree_differ_by_nothing():
    found = pooled([1.0, 1.01, 0.99], [0.1, 0.1, 0.1])
    assert found["between"] == 0.0 and found["heterogeneity"] == 0.0 and found["low"] < 1.0 < found["high"]
    assert found["high"] - found["low"] > 2 * 1.96 * 0.1 / math.sqrt(3)


def test_one_study_is_no_population():
    assert pooled([1.0], [0.1]) is None
    assert pooled([1.0, 2.0], [0.1, math.inf]) is None
    assert math.isinf(pooled([1.0, 2.0], [0.1, 0.1])["next_low"])


def test_intervals_cover_the_mean_of_a_population():
    rng, hits = np.random.default_rng(1), 0
    for _ in range(300):
        s = rng.uniform(0.1, 0.5, 8)
        found = pooled(rng.normal(2.0, 0.4, 8) + s * rng.standard_normal(8), s)
        hits += found["low"] < 2.0 < found["high"]
    assert 0.92 * 300 < hits < 0.985 * 300


def test_rates_count_every_cause_that_was_looked_for():
    assert discovery_rates([], 10).size == 0
    few, many = discovery_rates([1e-6, 1e-3], 2), discovery_rates([1e-6, 1e-3], 2000)
    assert few == pytest.approx([2e-6, 1e-3]) and many == pytest.approx([2e-3, 1.0])


def test_shares_have_wilsons_interval():
    assert share_interval(0, 10) == pytest.approx((0.0, 27.753), abs=1e-3)
    assert share_interval(5, 10) == pytest.approx((23.659, 76.341), abs=1e-3)


def test_a_gain_that_nothing_was_held_out_for_is_in_no_median():
    shared = {"cause": "coulomb_friction", "stage": "joint", "false_discovery_rate": 0.0, "equivalents": ""}
    rows = [{**shared, "study": s, "gain_percent": g} for s, g in (("a", math.nan), ("b", 40.0), ("c", 60.0))]
    assert prevalence_rows(rows, 3)[0]["median_gain_percent"] == 60.0
    assert math.isnan(prevalence_rows(rows[:1], 3)[0]["median_gain_percent"])
