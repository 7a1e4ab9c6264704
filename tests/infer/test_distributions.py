"""Distributions against SciPy's own."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.stats

from fes_pin.infer.distributions import chi2_quantile, chi2_tail, f_tail, normal_quantile, pearson3_tail


@pytest.mark.parametrize("degrees", [1, 2, 7, 70])
def test_chi_square(degrees: int) -> None:
    x, p = np.array([-1.0, 0.0, 0.3, 30.0, 900.0]), np.array([0.05, 0.5, 0.975])
    np.testing.assert_allclose(chi2_tail(x, degrees), scipy.stats.chi2.sf(x, degrees), rtol=1e-10)
    np.testing.assert_allclose(chi2_quantile(p, degrees), scipy.stats.chi2.ppf(p, degrees), rtol=1e-10)


@pytest.mark.parametrize("x", [-1.0, 0.1, 3.0, 300.0])
def test_fisher(x: float) -> None:
    assert f_tail(x, 3, 33.3) == pytest.approx(scipy.stats.f.sf(x, 3, 33.3), rel=1e-9)


@pytest.mark.parametrize("skewness", [0.01, 0.3, 2.0])
@pytest.mark.parametrize("x", [-5.0, 0.0, 3.0, 20.0])
def test_pearson_type_three(x: float, skewness: float) -> None:
    assert pearson3_tail(x, skewness) == pytest.approx(scipy.stats.pearson3.sf(x, skewness), rel=1e-7)


def test_normal() -> None:
    assert normal_quantile(0.975) == pytest.approx(scipy.stats.norm.ppf(0.975), rel=1e-12)
