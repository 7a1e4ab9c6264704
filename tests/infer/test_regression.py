"""The search knows no rig: on a linear regression it finds what is hidden, and alarms as often as it says."""

import numpy as np
import pytest
import scipy.stats
from infer.regression import COUNT, Regression

from fes_pin.infer.levels import CLAIM_LEVEL
from fes_pin.infer.search import Search

RUNS = 6


def columns(rng, count=20):
    return {f"x{k:02d}": rng.standard_normal(COUNT) for k in range(count)}


def searched(models):
    return Search(models, lambda share, words: None).run()


def test_two_of_twenty_are_found_and_their_intervals_hold():
    rng = np.random.default_rng(0)
    inside = exact = 0
    for _ in range(40):
        x = columns(rng)
        runs = 3.0 + 0.5 * x["x03"] - 0.4 * x["x11"] + rng.standard_normal((RUNS, COUNT))
        models = Regression(x, runs)
        found = searched(models)
        exact += found.best.free == ("x03", "x11")
        assert {"x03", "x11"} <= set(found.best.free)
        assert all(p < CLAIM_LEVEL for p in found.p_values.values())
        if found.best.free == ("x03", "x11"):
            best, true = found.best, {"x03": 0.5, "x11": -0.4}
            inside += sum(abs(best.values[n] - v) < best.reach(n) for n, v in true.items())
    assert exact >= scipy.stats.binom.ppf(0.001, 40, 1.0 - CLAIM_LEVEL)
    assert inside >= scipy.stats.binom.ppf(0.001, 2 * exact, 0.95)


def test_a_thousand_nulls_alarm_at_the_stated_rate():
    rng = np.random.default_rng(1)
    x, alarms = columns(rng), 0
    family = Regression(x, np.zeros((RUNS, COUNT))).family
    for _ in range(1000):
        models = Regression(x, rng.standard_normal((RUNS, COUNT)))
        models.family = family  # it depends on the columns alone
        found = searched(models)
        alarms += found.best is not found.nominal
    low, high = scipy.stats.binom.interval(0.999, 1000, CLAIM_LEVEL)
    assert low <= alarms <= high


def test_a_column_that_is_nearly_another_is_its_equivalent_and_no_other_is():
    rng = np.random.default_rng(2)
    x = columns(rng)
    x["x05"] = x["x03"] + 0.05 * rng.standard_normal(COUNT)
    models = Regression(x, 0.5 * x["x03"] + rng.standard_normal((RUNS, COUNT)))
    found = searched(models)
    (name,) = found.best.free
    near = models.equivalents(found.best, found.without[name], found.rivals[name])
    assert [f.free for f in near] == [tuple({"x03", "x05"} - {name})]


@pytest.mark.parametrize("changed", [False, True])
def test_a_group_that_changed_is_told_from_one_that_did_not(changed):
    """A change of one group is a candidate like others, with a site of its own."""
    rng = np.random.default_rng(3)
    x, groups = columns(rng, 8), np.arange(RUNS) % 2
    runs = 0.8 * x["x02"] + rng.standard_normal((RUNS, COUNT))
    runs[groups == 1] += 0.7 * changed * x["x05"]
    models = Regression(x, runs, groups)
    found = searched(models)
    assert found.best.free == (("x02", "x05:1") if changed else ("x02",))


def test_what_no_candidate_explains_is_a_lack_of_fit():
    rng = np.random.default_rng(4)
    x = columns(rng)
    models = Regression(x, rng.standard_normal((RUNS, COUNT)) + rng.standard_normal(COUNT))
    assert not models.leaves_noise(models.nominal())
    other = Regression(x, rng.standard_normal((RUNS, COUNT)))
    assert other.leaves_noise(other.nominal())


@pytest.mark.parametrize("site", ["", "@arm"], ids=["five causes", "one cause at five joints, and another"])
def test_a_cause_at_many_sites_counts_as_one(site):
    """At most three causes are searched: friction at every joint is one of them."""
    rng = np.random.default_rng(4)
    names = [*(f"friction@j{k}" if site else f"x{k}" for k in range(5)), f"offset{site}"]
    x = {n: rng.standard_normal(COUNT) for n in [*names, "a", "b", "c"]}
    found = searched(Regression(x, 0.8 * sum(x[n] for n in names) + rng.standard_normal((RUNS, COUNT))))
    assert found.best.free == tuple(sorted(names)) if site else len(found.best.free) == 3
