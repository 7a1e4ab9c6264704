"""Effects of many studies together: random-effects meta-analysis, and the false discovery rate over the cohort.

Study i measures y_i with standard deviation s_i of a true value that differs from study to study by tau:

    mu = sum w_i y_i / sum w_i,   w_i = 1 / (s_i^2 + tau^2),   sum w_i (y_i - mu)^2 = k - 1

tau^2 is what makes the last equation hold, 0 where nothing does (Paule, Mandel). The interval of mu is that of Hartung
and Knapp, with k - 1 degrees of freedom: the usual one is too narrow for few studies. Where the next study would lie is
t_(k-2) sqrt(tau^2 + se^2) about mu.

Source: Paule and Mandel, Consensus values and weighting factors, J. Res. Natl. Bur. Stand. 87 (1982); Knapp and
Hartung, Improved tests for a random effects meta-regression with a single covariate, Statistics in Medicine 22 (2003);
Higgins, Thompson and Spiegelhalter, A re-evaluation of random-effects meta-analysis, J. R. Stat. Soc. A 172 (2009);
Benjamini and Hochberg, Controlling the false discovery rate, J. R. Stat. Soc. B 57 (1995).
"""

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq
from scipy.stats import binomtest, chi2, false_discovery_control, t

from fes_pin.infer.family import SMALLEST_P


def pooled(values: Sequence[float], stds: Sequence[float]) -> dict[str, float] | None:
    """Return the value in the population that at least two studies are of, by a random-effects model.

    Parameters
    ----------
    values, stds
        Of each study, in one unit.

    Returns
    -------
    dict or None
        None for fewer than two studies that have a finite value and deviation. By name: the number of `studies`; the
        `mean` of the population with its 95 % interval from `low` to `high`; `between`, which is tau; `next_low` and
        `next_high`, where the true value of one more study would lie in 95 of 100, infinite for fewer than 3 studies;
        `heterogeneity`, I^2, the share of the scatter that is not the studies' own uncertainty, percent; `p_alike`, the
        p-value that all studies have one value (Cochran's Q).
    """
    y, s = np.asarray(values, dtype=float), np.asarray(stds, dtype=float)
    good = np.isfinite(y) & np.isfinite(s) & (s > 0.0)
    y, s = y[good], s[good]
    k = len(y)
    if k < 2:
        return None
    size = float(np.abs(s).max())  # in units of the largest deviation, whatever the unit of the value
    y, s = y / size, s / size
    square = _between(y, s)
    w = 1.0 / (s**2 + square)
    mu = float(np.sum(w * y) / np.sum(w))
    scatter = float(np.sum(w * (y - mu) ** 2)) / (k - 1)
    error = math.sqrt(max(scatter, 1.0) / float(np.sum(w)))  # never narrower than the studies' own uncertainty allows
    half = float(t.ppf(0.975, k - 1)) * error
    reach = float(t.ppf(0.975, k - 2)) * math.hypot(math.sqrt(square), error) if k > 2 else math.inf
    q = _cochran(y, s, 0.0)
    return {
        "studies": k,
        "mean": mu * size,
        "low": (mu - half) * size,
        "high": (mu + half) * size,
        "between": math.sqrt(square) * size,
        "next_low": (mu - reach) * size,
        "next_high": (mu + reach) * size,
        "heterogeneity": 100.0 * max(0.0, (q - (k - 1)) / q) if q > 0.0 else 0.0,
        "p_alike": max(float(chi2.sf(q, k - 1)), SMALLEST_P),
    }


def _cochran(y: np.ndarray, s: np.ndarray, square: float) -> float:
    w = 1.0 / (s**2 + square)
    return float(np.sum(w * (y - np.sum(w * y) / np.sum(w)) ** 2))


def _between(y: np.ndarray, s: np.ndarray) -> float:
    """tau^2 of Paule and Mandel."""
    wanted = len(y) - 1.0
    if _cochran(y, s, 0.0) <= wanted:
        return 0.0
    most = 2.0 * float(np.var(y, ddof=1))  # the sum is at most k - 1 from the variance of y on
    return float(brentq(lambda x: _cochran(y, s, x) - wanted, 0.0, most, xtol=1e-14))


def discovery_rates(p_values: Sequence[float], tests: int) -> np.ndarray:
    """False discovery rate at which each would be claimed, shape (n,), by Benjamini and Hochberg.

    Parameters
    ----------
    p_values
        Of the causes that were named.
    tests
        Causes that were looked for, in all studies together. Of those that were not named no p-value is known; they
        count as 1, which makes the rates of the others larger, never smaller.
    """
    p = np.clip(np.asarray(p_values, dtype=float), 0.0, 1.0)
    if len(p) == 0:
        return p
    whole = np.concatenate([p, np.ones(max(tests - len(p), 0))])
    return np.asarray(false_discovery_control(whole, method="bh"))[: len(p)]


def share_interval(named: int, studies: int) -> tuple[float, float]:
    """95 % interval of a share, percent, by Wilson (J. Am. Stat. Assoc. 22, 1927)."""
    if studies == 0:
        return 0.0, 100.0
    ends = binomtest(named, studies).proportion_ci(method="wilson")
    return 100.0 * float(ends.low), 100.0 * float(ends.high)
