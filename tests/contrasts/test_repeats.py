"""Repeats that differ: the scatter of nominal parameters between trials, and what stands out beside it."""

from dataclasses import replace

import numpy as np
import pytest
from contrast_pairs.free import free_pair

import fes_pin as fp
from fes_pin.contrasts.repeats import RepeatedProblem, scatter
from fes_pin.infer.problem import Linearized
from fes_pin.infer.projection import without_locals
from fes_pin.models.nominal import nominal_model
from fes_pin.search.likelihood_fits import MEASUREMENT, LikelihoodFits


def drawn(deviation, seed, trials=60):
    """Trials of a straight line whose slope scatters about one mean, with noise 1."""
    rng = np.random.default_rng(seed)
    x = np.linspace(0.0, 10.0, 80)
    out = []
    for _ in range(trials):
        residual = x * deviation * rng.standard_normal() + rng.standard_normal(len(x))
        out.append(Linearized(residual, x[:, None], np.ones((len(x), 1))))
    return out


@pytest.mark.parametrize("seed", range(3))
def test_scatter_is_found_at_its_size(seed):
    parts = drawn(0.5, seed)
    found = scatter(parts, [without_locals(p, p.jacobian) for p in parts], ["slope"])
    assert found["slope"] == pytest.approx(0.5, rel=3.0 / np.sqrt(2.0 * len(parts)))


@pytest.mark.parametrize("seed", range(5))
def test_trials_alike_do_not_scatter(seed):
    parts = drawn(0.0, seed)
    found = scatter(parts, [without_locals(p, p.jacobian) for p in parts], ["slope"])
    assert found.get("slope", 0.0) < 0.03


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200])
@pytest.mark.parametrize("field", ["residual", "jacobian", "columns"])
def test_a_trial_beyond_floating_point_numbers_scatters_by_nothing(bad, field):
    """Eigenvalues of three parameters or more do not converge where a product is no number."""
    x = np.linspace(0.0, 10.0, 80)[:, None] ** np.arange(1, 5)
    noise = np.random.default_rng(0).standard_normal((6, len(x)))
    parts = [Linearized(r, x, np.ones((len(x), 1))) for r in noise]
    columns = [without_locals(p, p.jacobian) for p in parts]
    spoilt = columns[3].copy() if field == "columns" else getattr(parts[3], field).copy()
    spoilt[5] = bad
    if field == "columns":
        columns[3] = spoilt
    else:
        parts[3] = replace(parts[3], **{field: spoilt})
    assert scatter(parts, columns, ["a", "b", "c", "d"]) == {}


@pytest.fixture
def muscle(tmp_path):
    """A fit of a muscle by the likelihood, and its trials."""
    study = free_pair("muscle", (), 80.0, 3, tmp_path)
    models = LikelihoodFits(nominal_model(study), study.trials, (), answered=False, noise=MEASUREMENT)
    return models.nominal()


SIZES = {"gain": 0.01, "time_constant_s": 0.002}


def test_the_squares_are_those_of_the_covariance(muscle):
    """r' (I + V D^2 V')^-1 r and its log-determinant, as dense matrices have them."""
    problem = RepeatedProblem(muscle.model, muscle.trials, muscle.noise, SIZES)
    plain = problem.plain(muscle.values, muscle.unknowns)
    for one, two in zip(plain, problem.linearize(muscle.values, muscle.unknowns), strict=True):
        v = without_locals(one, one.jacobian) * list(SIZES.values())
        covariance = np.eye(len(one.residual)) + v @ v.T
        assert two.residual @ two.residual == pytest.approx(one.residual @ np.linalg.solve(covariance, one.residual))
        more = two.log_determinant - one.log_determinant
        assert more == pytest.approx(np.linalg.slogdet(covariance)[1])
        assert two.jacobian.T @ two.jacobian == pytest.approx(
            one.jacobian.T @ np.linalg.solve(covariance, one.jacobian), rel=1e-6
        )


def test_noise_is_found_in_what_trials_do_not_differ_by(muscle):
    """Of a reading r that is whitened it is (I + V D^2 V')^-1 r, with the likeliest start of each trial."""
    white = replace(muscle.noise, ar={})
    problem = RepeatedProblem(muscle.model, muscle.trials, white, SIZES)
    run = problem.residual_run(muscle.values, muscle.unknowns)
    for one, left in zip(problem.plain(muscle.values, muscle.unknowns), run, strict=True):
        v = without_locals(one, one.jacobian) * list(SIZES.values())
        expected = np.linalg.solve(np.eye(len(v)) + v @ v.T, one.residual)
        assert problem.whitened(left).residual == pytest.approx(expected, abs=1e-9)


def test_a_change_shows_through_trials_that_scatter(tmp_path):
    """The threshold of a muscle whose strength differs from trial to trial, six trials in all."""
    found = fp.contrast(free_pair("muscle", ("threshold_shift",), 80.0, 999083, tmp_path))
    (change,) = found.changes
    assert change.name == "threshold_shift"
    assert found.repeats["gain"] == pytest.approx(0.003, rel=1.0)
    assert "repeats scatter by (standard deviation): gain" in str(found)
