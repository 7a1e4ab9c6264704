"""Family-wise p-values over a whole library of candidates, from the joint distribution of their scores.

Source: Hothorn, Bretz and Westfall, Simultaneous inference in general parametric models, Biometrical Journal 50 (2008),
for the distribution of the largest of correlated statistics by simulation.
"""

import math
from collections.abc import Sequence

import numpy as np

from fes_pin.infer.distributions import chi2_tail, normal_quantile
from fes_pin.infer.levels import SEEN_POWER

DRAWS = 4000
"""Simulated score vectors; the 5 % quantile of the smallest p-value then has a standard error of 7 %."""

SMALLEST_P = 1e-300
"""Smallest p-value that is returned: double precision cannot represent much smaller ones."""


class Family:
    """The joint distribution of all scores of a library under the null that no candidate acts.

    The scores are jointly Gaussian. One simulation of them gives the distribution of the smallest p-value, and with it
    the number of independent tests that is equivalent to the family.

    Parameters
    ----------
    gram
        Shape (k, k): inner products of the candidates' columns, with the fitted parameters projected off.
    blocks
        Rows of `gram` of each test.
    seed
        Of the simulation.
    others
        Number of further tests, which are taken as independent: an upper bound.
    """

    def __init__(self, gram: np.ndarray, blocks: Sequence[slice], seed: int, others: int = 0) -> None:
        norms = np.sqrt(np.maximum(np.diag(gram), 0.0))
        scale = 1.0 / np.where(norms > 0, norms, 1.0)
        self.tests = _effective_tests(gram * np.outer(scale, scale), blocks, seed) + others

    def p_value(self, gain: float, degrees: int) -> float:
        """Return the family-wise p-value of a gain in twice the log-likelihood."""
        return self.adjusted(float(chi2_tail(max(gain, 0.0), degrees)))

    def adjusted(self, single: float) -> float:
        """Return the family-wise p-value for the smallest p-value of the family."""
        return max(float(-np.expm1(self.tests * np.log1p(-min(single, 1 - 1e-16)))), SMALLEST_P)


class SimulatedFamily:
    """Family-wise p-values of the largest gain of a library, from its gains in data simulated without a cause.

    The largest of many gains follows a Gumbel distribution; its location and scale come from mean and deviation.
    Source: Gumbel, Statistics of Extremes, 1958.

    Parameters
    ----------
    largest
        Shape (draws,): the largest gain of each simulation.
    """

    def __init__(self, largest: np.ndarray) -> None:
        self.scale = max(float(np.std(largest)) * math.sqrt(6.0) / math.pi, 1e-6)
        self.place = float(np.mean(largest)) - float(np.euler_gamma) * self.scale

    def p_value(self, gain: float) -> float:
        """Return the probability of at least this gain; 1 where nothing is gained."""
        if gain <= 0.0:
            return 1.0
        return max(float(-np.expm1(-np.exp(-(gain - self.place) / self.scale))), SMALLEST_P)


def least_seen(level: float, tests: float) -> float:
    """Return the size, in standard deviations, that a family of tests at a level finds with the power `SEEN_POWER`."""
    single = 1.0 - (1.0 - level) ** (1.0 / tests)
    return normal_quantile(1.0 - 0.5 * single) + normal_quantile(SEEN_POWER)


def _effective_tests(gram: np.ndarray, blocks: Sequence[slice], seed: int) -> float:
    """Return the number of independent tests with the same distribution of the smallest p-value."""
    values, vectors = np.linalg.eigh(gram)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    draws = np.random.default_rng(seed).standard_normal((DRAWS, len(gram))) @ root.T
    largest: dict[int, np.ndarray] = {}
    for block in blocks:
        own = gram[block, block]
        rank = int(np.linalg.matrix_rank(own, tol=1e-8))
        if rank:
            part = draws[:, block]
            statistic = np.einsum("ni,ni->n", part @ np.linalg.pinv(own, rcond=1e-8), part)
            largest[rank] = np.maximum(largest.get(rank, 0.0), statistic)
    if not largest:
        return 1.0
    smallest = np.min([chi2_tail(s, k) for k, s in largest.items()], axis=0)
    return max(1.0, float(np.log(0.95) / np.log1p(-np.quantile(smallest, 0.05))))
