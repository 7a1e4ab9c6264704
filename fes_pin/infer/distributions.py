"""Tails and quantiles of the distributions that tests use, from SciPy's special functions.

`scipy.stats` has the same numbers, but loading it takes longer than many a fit.
"""

import math
from typing import Any

import numpy as np
from scipy import special


def normal_quantile(p: float) -> float:
    """Return a quantile of the standard normal distribution."""
    return float(special.ndtri(p))


def normal_tail(x: float) -> float:
    """Return P(X > x) for the standard normal distribution."""
    return float(special.ndtr(-x))


def chi2_tail(x: Any, degrees: float) -> Any:
    """Return P(X > x) for a chi-square distribution; numbers or arrays of any shape."""
    return special.gammaincc(0.5 * degrees, np.maximum(x, 0.0) * 0.5)


def chi2_quantile(p: Any, degrees: float) -> Any:
    """Return a quantile of a chi-square distribution; numbers or arrays of any shape."""
    return 2.0 * special.gammaincinv(0.5 * degrees, p)


def f_tail(x: float, over: float, under: float) -> float:
    """Return P(X > x) for Fisher's F of `over` and `under` degrees of freedom."""
    return float(special.fdtrc(over, under, max(x, 0.0)))


def pearson3_tail(x: float, skewness: float) -> float:
    """Return P(X > x) for the gamma distribution of mean 0, variance 1 and a skewness > 0 (Pearson type III)."""
    shape = 4.0 / skewness**2
    return float(special.gammaincc(shape, max(shape + math.sqrt(shape) * x, 0.0)))
