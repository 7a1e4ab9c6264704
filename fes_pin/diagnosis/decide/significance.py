"""Critical values over a whole library: the largest of many correlated scores under the nominal model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fes_pin.diagnosis.search.score import Scores
from fes_pin.identify.fit import Fit
from fes_pin.infer.distributions import chi2_tail, f_tail
from fes_pin.infer.levels import CLAIM_LEVEL, DRIVEN_LEVEL

DRAWS = 4000
"""Simulated score vectors; the 5 % quantile of the smallest p-value then has a standard error of 7 %."""

SMALLEST_P = 1e-300
"""What a p-value that double precision cannot tell from 0 is given as."""

MIN_UNITS = 8
"""Units of evidence that coherence is judged on, at least."""


class Family:
    """All (effect, shape) scores of a library under the hypothesis that nothing is missing.

    The scores are jointly Gaussian; one simulation of them gives the distribution of the smallest p-value, and with it
    the number of independent tests that the family amounts to. Effects with amplitudes of each trial's own count as one
    test more for each of their shapes, which is the most that they can be.
    """

    def __init__(self, scores: Scores, seed: int) -> None:
        norms = np.sqrt(np.maximum(np.diag(scores.gram), 0.0))
        scale = 1.0 / np.where(norms > 0, norms, 1.0)
        self.tests = _effective_tests(scores.gram * np.outer(scale, scale), scores.blocks, seed)
        self.tests += sum(s.probe.effect.each_trial for s in scores.scored)

    def p_value(self, gain: float, degrees: int) -> float:
        """Family-wise p-value of a drop in twice the negative log-likelihood."""
        single = float(chi2_tail(max(gain, 0.0), degrees))
        return self.adjusted(single)

    def adjusted(self, single: float) -> float:
        """Family-wise p-value of the smallest of the family's p-values."""
        return max(float(-np.expm1(self.tests * np.log1p(-min(single, 1 - 1e-16)))), SMALLEST_P)


def level_of(fitted: Fit) -> float:
    """At which something is claimed beside a fit by the likelihood, or of what it leaves.

    A random effort is of the first order in the model, and as it may be in the rig: noise that is known by less.
    """
    assert fitted.doubt is not None
    return DRIVEN_LEVEL if fitted.doubt.acting else CLAIM_LEVEL


def coherence_p_value(smaller: Fit, larger: Fit, degrees: int) -> float:
    """p-value of a gain against its spread between trials, whatever the noise within each.

    With x_i what the larger model adds to trial i and r_i what it leaves there, x_i' r_i / |x_i| has the variance phi
    of the noise along x_i; gain / (degrees phi) is compared with Fisher's F.
    """
    gain = smaller.sse - larger.sse
    units = [
        (float(x @ x), float(x @ r))
        for few, many in zip(smaller.parts, larger.parts, strict=True)
        for x, r in _pieces(few.residual - many.residual, many.residual, len(larger.parts), degrees)
    ]
    felt = [(size, along) for size, along in units if size > 1e-4 * max(u[0] for u in units)]
    free = len(felt) - degrees
    if free < 1 or gain <= 0:
        return 1.0
    phi = sum(along**2 / size for size, along in felt) / free
    return f_tail(gain / (degrees * max(phi, 1e-12)), degrees, free)


def _pieces(added: np.ndarray, left: np.ndarray, trials: int, degrees: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """A trial as one unit of evidence, or in pieces where there are few trials for the degrees of freedom."""
    count = max(1, -(-max(MIN_UNITS, 2 * degrees) // trials))
    return zip(np.array_split(added, count), np.array_split(left, count), strict=True)


def _effective_tests(gram: np.ndarray, blocks: Sequence[slice], seed: int) -> float:
    """Independent tests that would make the smallest p-value as small."""
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
