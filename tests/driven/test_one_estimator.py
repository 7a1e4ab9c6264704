"""A model of the same trials has the same values by `fit`, `diagnose` and `compare`, or the estimator is named."""

import math
from pathlib import Path

import numpy as np
import pytest
from comparison import twins
from driven_rigs.laboratory import draw_laboratory
from identify.rigs import WHITE, off, trials_of
from scipy.signal import lfilter
from scipy.stats import multivariate_normal

import fes_pin as fp
from fes_pin.infer.scoring import LITTLE
from fes_pin.search.likelihood_fits import ESTIMATORS, MEASUREMENT
from fes_pin.search.likelihood_fits import WHITE as LEAST_SQUARES

DEMO = fp.read_study(Path(__file__).parents[2] / "analysis/studies/ankle_demo")


def agree(one, other):
    """Both are at one maximum: to what a fit may still gain, and to a hundredth of the standard deviations."""
    assert one.free == other.free and one.samples == other.samples
    assert one.sse == pytest.approx(other.sse, abs=LITTLE)
    assert all(one.values[n] == pytest.approx(other.values[n], abs=0.01 * one.std(n)) for n in one.free)


@pytest.fixture(scope="module")
def found():
    return fp.diagnose(DEMO)


@pytest.fixture(scope="module")
def fitted():
    return fp.fit(fp.nominal_model(DEMO), DEMO)


def test_a_fit_of_the_nominal_model_is_that_of_a_diagnosis(found, fitted):
    assert found.why.estimator == ESTIMATORS[MEASUREMENT]
    agree(fitted, found.nominal)


def test_a_fit_of_the_extended_model_is_that_of_a_diagnosis(found):
    """But for autoregressions: an extended model keeps the orders that those of the nominal model have."""
    one, other = fp.fit(found.model, DEMO), found.extended
    assert one.free == other.free and not any(one.noise.ar.values()) and any(other.noise.ar.values())
    assert all(one.values[n] == pytest.approx(other.values[n], abs=0.1 * one.std(n)) for n in one.free)


def test_in_closed_loop_a_fit_is_that_of_a_diagnosis(tmp_path):
    """Of a diagnosis that ends at once: the first fit of the nominal model is made whatever its limit of time."""
    study = fp.read_study(draw_laboratory((), 1600003, tmp_path).study)
    fitted = fp.fit(fp.nominal_model(study), study)
    assert fitted.noise.acting
    agree(fitted, fp.diagnose(study, limit=1.0).nominal)


@pytest.mark.parametrize("study", [DEMO, twins.study("lag", 13)], ids=lambda s: s.name)
def test_a_comparison_has_the_values_of_least_squares_and_says_so(study):
    compared = fp.compare(study, ["nominal"])
    alone = fp.fit(fp.nominal_model(study), study, least_squares=True)
    assert compared.models[0].fit.values == pytest.approx(alone.values, rel=1e-9)
    assert compared.record()["estimator"] == ESTIMATORS[LEAST_SQUARES] and ESTIMATORS[LEAST_SQUARES] in str(compared)


def test_a_printed_fit_says_where_it_began_and_whether_it_leaves_noise(found, fitted):
    start = fp.nominal_model(DEMO).parameters()
    assert fitted.start == start and fitted.to_frame()["start"].to_dict() == {n: start[n] for n in fitted.free}
    assert fitted.lack_of_fit.unexplained
    assert f"the model leaves more than noise ({fitted.lack_of_fit.tested()})" in str(fitted)
    assert "lack of fit: none found (p = " in str(fp.fit(found.model, DEMO))


def test_the_likelihood_of_known_noise_is_that_of_a_gaussian():
    model, trials = trials_of("muscle", np.random.default_rng(0))
    fitted = fp.fit(off(model), trials, WHITE)
    left = np.concatenate([t.residual(fp.simulate(fitted.model, t), "force_n") for t in trials])
    size = WHITE["force_n"].std
    by_hand = float(np.sum(-0.5 * (left / size) ** 2 - math.log(size * math.sqrt(2.0 * math.pi))))
    assert fitted.loglikelihood == pytest.approx(by_hand, rel=1e-9)
    assert fitted.aic == pytest.approx(2 * 2 - 2 * by_hand)
    assert fitted.bic == pytest.approx(2 * math.log(len(left)) - 2 * by_hand)


def test_the_likelihood_of_estimated_noise_is_that_of_a_gaussian_with_its_covariance():
    """Of autoregressive noise, by the covariance matrix of a whole trial."""
    model, trials = trials_of("muscle", rng := np.random.default_rng(0))
    coloured = [lfilter([0.5], [1.0, -0.8], rng.standard_normal(len(t))) for t in trials]
    trials = [t.with_columns(force_n=t["force_n"] + e) for t, e in zip(trials, coloured, strict=True)]
    fitted = fp.fit(off(model), trials)
    noise, by_hand = fitted.noise["force_n"], 0.0
    assert noise.ar
    for one in trials:
        left = one.residual(fp.simulate(fitted.model, one), "force_n")
        by_hand += multivariate_normal.logpdf(left, cov=covariance(noise, len(left)))
    assert fitted.loglikelihood == pytest.approx(by_hand, rel=1e-6)
    assert fitted.aic == pytest.approx(2 * (2 + 1 + len(noise.ar)) - 2 * by_hand, rel=1e-6)


def covariance(noise, n):
    """The covariance matrix of autoregressive noise that began long before its first sample."""
    before = 2000
    inverse = np.eye(before + n)
    for k, one in enumerate(noise.ar, 1):
        inverse -= one * np.eye(before + n, k=-k)
    made = np.linalg.inv(inverse)[before:]
    return noise.innovation_std**2 * made @ made.T


def test_correlated_estimates_are_listed():
    model, trials = trials_of("joint", np.random.default_rng(2))
    fitted = fp.fit(off(model), trials, WHITE)
    std = np.sqrt(np.diag(fitted.covariance))
    assert fitted.correlations * np.outer(std, std) == pytest.approx(fitted.covariance)
    pair = np.argwhere(np.triu(np.abs(fitted.correlations) > 0.9, 1))
    assert ("correlations above 0.9" in str(fitted)) == bool(len(pair))
    for i, k in pair:
        assert f"{fitted.free[i]}, {fitted.free[k]} {fitted.correlations[i, k]:.3f}" in str(fitted)
