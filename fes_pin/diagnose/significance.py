"""Critical values over a whole library: the largest of many correlated scores under the nominal model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.stats

from fes_pin.diagnose.library import Probe, Projection

DRAWS = 4000
"""Simulated score vectors; the 5 % quantile of the smallest p-value then has a standard error of 7 %."""


class Family:
    """All (effect, shape) scores of a library under the hypothesis that nothing is missing.

    The scores are jointly Gaussian; one simulation of them gives the distribution of the smallest p-value, and with it
    the number of independent tests that the family amounts to.
    """

    def __init__(self, projection: Projection, probes: Sequence[Probe], seed: int) -> None:
        columns = [projection(p.columns) for p in probes]
        norms = [np.linalg.norm(c, axis=0) for c in columns]
        kept = [c / np.where(n > 0, n, 1.0) for c, n in zip(columns, norms, strict=True)]
        self.tests = _effective_tests(kept, seed) if kept else 1.0

    def p_value(self, gain: float, degrees: int) -> float:
        """Family-wise p-value of a drop in twice the negative log-likelihood."""
        single = float(scipy.stats.chi2.sf(max(gain, 0.0), degrees))
        return float(-np.expm1(self.tests * np.log1p(-min(single, 1 - 1e-16))))


def _effective_tests(columns: Sequence[np.ndarray], seed: int) -> float:
    stacked = np.concatenate(columns, axis=1)
    gram = stacked.T @ stacked
    values, vectors = np.linalg.eigh(gram)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    draws = np.random.default_rng(seed).standard_normal((DRAWS, len(gram))) @ root.T
    smallest = np.ones(DRAWS)
    at = 0
    for c in columns:
        block = slice(at, at + c.shape[1])
        at = block.stop
        inverse = np.linalg.pinv(gram[block, block], rcond=1e-8)
        rank = np.linalg.matrix_rank(gram[block, block], tol=1e-8)
        if rank == 0:
            continue
        statistic = np.einsum("ni,ij,nj->n", draws[:, block], inverse, draws[:, block])
        smallest = np.minimum(smallest, scipy.stats.chi2.sf(statistic, rank))
    quantile = float(np.quantile(smallest, 0.05))
    return max(1.0, float(np.log(0.95) / np.log1p(-quantile)))
