"""The score of amplitudes that are each trial's own, beside least squares with all their columns."""

import numpy as np
import pytest
import scipy.stats

from fes_pin.infer.levels import PARAMETER_PENALTY
from fes_pin.infer.problem import Linearized
from fes_pin.infer.projection import Projection
from fes_pin.models.effects.mains_hum import MainsHum
from fes_pin.search.score import score_test

TRIALS, ROWS = 4, 60


def parts_of(rng, unknowns):
    """Noise, three parameters, some unknowns of each trial, a probe that the last trial does not feel."""
    parts = [
        Linearized(rng.standard_normal(ROWS), rng.standard_normal((ROWS, 3)), rng.standard_normal((ROWS, unknowns)))
        for _ in range(TRIALS)
    ]
    columns = rng.standard_normal((TRIALS * ROWS, 2))
    columns[-ROWS:] = 0.0
    return parts, columns


def side_by_side(columns, trials=TRIALS):
    out = np.zeros((len(columns), columns.shape[1] * trials))
    for k in range(trials):
        out[k * ROWS : (k + 1) * ROWS, k * columns.shape[1] : (k + 1) * columns.shape[1]] = columns[k * ROWS :][:ROWS]
    return out


def left(columns, y):
    return float(np.sum((y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]) ** 2))


@pytest.mark.parametrize("unknowns", [0, 2])
def test_the_score_is_that_of_least_squares(unknowns):
    parts, columns = parts_of(np.random.default_rng(unknowns), unknowns)
    common, own = score_test(parts, [(MainsHum.absent(), columns)]).scored
    assert own.effect.each_trial and not common.effect.each_trial
    y = np.concatenate([p.residual for p in parts])
    local = np.zeros((TRIALS * ROWS, 0))
    if unknowns:
        local = side_by_side(np.concatenate([p.local for p in parts]))
    base = np.hstack([np.concatenate([p.jacobian for p in parts]), local])
    extra = side_by_side(columns)[:, :-2]  # the last trial feels nothing
    drop = left(base, y) - left(np.hstack([base, extra]), y)
    assert own.gain == pytest.approx(drop - PARAMETER_PENALTY * (extra.shape[1] - 2), rel=1e-9)


def test_under_the_null_it_is_chi_square():
    """With two degrees of freedom for each trial that feels it; and it hardly ever pays its price."""
    rng, gains = np.random.default_rng(5), []
    parts, columns = parts_of(rng, 2)
    degrees = 2 * (TRIALS - 1)
    for _ in range(500):
        noisy = [Linearized(rng.standard_normal(ROWS), p.jacobian, p.local) for p in parts]
        gains.append(score_test(noisy, [(MainsHum.absent(), columns)]).scored[1].gain)
    chi2 = np.array(gains) + PARAMETER_PENALTY * (degrees - 2)
    assert scipy.stats.kstest(chi2, "chi2", args=(degrees,)).pvalue > 1e-3
    assert np.mean(np.array(gains) > PARAMETER_PENALTY * 2) < 0.02


def test_an_unknown_that_no_trial_feels_takes_nothing():
    """A column of zeros is no direction: what is projected is the same with and without it."""
    parts, columns = parts_of(np.random.default_rng(6), 1)
    wider = [Linearized(p.residual, p.jacobian, np.hstack([p.local, np.zeros((ROWS, 2))])) for p in parts]
    assert np.allclose(Projection(parts)(columns), Projection(wider)(columns), atol=1e-12)


def test_a_probe_that_runs_away_tells_nothing_and_takes_nothing_from_another():
    """Squares of its columns would leave the floating-point numbers."""
    parts, columns = parts_of(np.random.default_rng(5), 1)
    runs_away = (MainsHum.absent(), np.full_like(columns, 1e200))
    alone = score_test(parts, [(MainsHum.absent(), columns)])
    beside = score_test(parts, [(MainsHum.absent(), columns), runs_away])
    assert beside.scored[0].gain == pytest.approx(alone.scored[0].gain, rel=1e-9)
    assert beside.scored[1].gain == 0.0
    assert np.isfinite(beside.gram).all()
