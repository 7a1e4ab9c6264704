"""Error rates of what is simulated: the family, coherence between trials, the remainder; folds; the next experiment."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
from diagnosis.hidden import study_of
from identify.rigs import WHITE, trials_of

from fes_pin.diagnosis.decide.held_out import folds_of
from fes_pin.diagnosis.decide.significance import Family, coherence_p_value
from fes_pin.diagnosis.remainder.open_set import unexplained_remainder
from fes_pin.diagnosis.search.score import Scores
from fes_pin.identify.fit import fit
from fes_pin.identify.problem import Linearized
from fes_pin.models.predict import predict


@pytest.mark.parametrize("correlation", [0.0, 0.6, 0.95])
def test_the_family_wise_error_is_what_it_says(correlation):
    """Under the null the smallest of 40 correlated tests, of one and two degrees, is below 5 % in 5 % of studies."""
    rng = np.random.default_rng(0)
    count, runs = 60, 4000
    gram = (1.0 - correlation) * np.eye(count) + correlation
    gram *= np.outer(scale := rng.uniform(0.1, 10.0, count), scale)
    blocks = [slice(k, k + 1) for k in range(20)] + [slice(20 + 2 * k, 22 + 2 * k) for k in range(20)]
    family = Family(Scores([], gram, np.zeros(count), blocks), seed=1)
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
    family = Family(Scores([], np.array([[4.0]]), np.zeros(1), [slice(0, 1)]), seed=0)
    assert family.tests == pytest.approx(1.0, abs=0.25)
    assert family.p_value(0.0, 1) == pytest.approx(1.0)
    assert family.p_value(40.0, 1) < 1e-8


def test_coherence_is_uniform_under_the_null():
    """A direction in every trial, noise of unknown size: F-distributed, so that p-values are uniform."""
    rng = np.random.default_rng(2)
    model, trials = trials_of("muscle", rng, count=8, n=60)
    fitted = fit(model, trials, WHITE)
    p_values = []
    for _ in range(300):
        size = rng.uniform(0.5, 3.0)
        directions = [rng.standard_normal(60) for _ in trials]
        noise = [size * rng.standard_normal(60) for _ in trials]
        along = sum(x @ e for x, e in zip(directions, noise, strict=True)) / sum(x @ x for x in directions)
        few = [_part(e) for e in noise]
        many = [_part(e - along * x) for x, e in zip(directions, noise, strict=True)]
        one, other = (replace(fitted, parts=tuple(p), sse=sum(q.residual @ q.residual for q in p)) for p in (few, many))
        p_values.append(coherence_p_value(one, other, 1))
    assert scipy.stats.kstest(p_values, "uniform").pvalue > 1e-3


def _part(residual):
    return Linearized(residual, np.zeros((len(residual), 0)), np.zeros((len(residual), 0)))


def test_the_remainder_keeps_its_level():
    """In 100 studies without a remainder one in a hundred has one: more than five would be a defect (P = 5e-4)."""
    rng = np.random.default_rng(3)
    model, trials = trials_of("muscle", rng, count=5, n=300)
    clean = [predict(model, t) for t in trials]
    found = 0
    for _ in range(100):
        noisy = [
            t.with_columns(force_n=c["force_n"] + 0.2 * rng.standard_normal(len(t)))
            for t, c in zip(trials, clean, strict=True)
        ]
        found += unexplained_remainder(fit(model, noisy, WHITE)).unexplained
    assert found <= 5


def test_a_smooth_remainder_is_located():
    rng = np.random.default_rng(4)
    model, trials = trials_of("muscle", rng, count=5, n=300)
    bent = [t.with_columns(force_n=t["force_n"] + 0.4 * (t.time / t.time[-1]) ** 2) for t in trials]
    left = unexplained_remainder(fit(model, bent, WHITE))
    assert left.unexplained and left.p_value < 1e-6
    assert left.where in {"time", "history", "offset"}
    assert unexplained_remainder(fit(model, bent, WHITE), seed=9).where == left.where


def test_folds_leave_out_whole_trials_of_every_kind():
    trials = study_of("ankle", n_motion=6, n_isometric=4, duration_s=2.0).trials
    folds = folds_of(trials)
    assert sorted(i for f in folds for i in f) == list(range(len(trials)))
    assert len(folds) == 5
    assert [len(f) for f in folds_of(trials[:3])] == [1, 1, 1]
    for fold in folds:  # what is left has both kinds and both loads
        left = [t for i, t in enumerate(trials) if i not in fold]
        assert {t.kind for t in left} == {"motion", "isometric"}
        assert {t.conditions.get("load_kg") for t in left} >= {1.0, 1.5}
