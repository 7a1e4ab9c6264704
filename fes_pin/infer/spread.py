"""Tests of gains against their spread between units of evidence, whatever the noise within each.

Let x_i be the difference between the predictions of two models for unit i, and r_i the residual of the larger one. The
variance of x_i' r_i / |x_i| is phi, which is 1 where units differ by their noise alone. It is estimated with the units'
shares of the gain as weights. Few units estimate it poorly along one x, but every candidate of a library gives an
estimate. If ln phi scatters among candidates no more than f degrees of freedom explain, phi is common to all.
Otherwise the usual phi0 has the degrees of freedom f0 that follow from that scatter. Both estimates together are

    phi = max(phi, (f0 phi0 + f phi) / (f0 + f)),

with a smaller f0 the more significantly phi exceeds phi0, and gain / (degrees phi) is compared with Fisher's F of
f0 + f degrees.
Source: Smyth, Stat. Appl. Genet. Mol. Biol. 3 (2004), article 3, sections 3 and 6.2.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import optimize, special

from fes_pin.infer.distributions import f_tail
from fes_pin.infer.levels import UNFELT, UNUSUAL_LEVEL
from fes_pin.infer.problem import Linearized
from fes_pin.infer.projection import slices

FEWEST_TRIALS = 6
"""Number of trials that estimate the differences between repeats by themselves; fewer trials are cut into pieces."""
MIN_UNITS = 8
"""Least number of units of evidence from which the spread is estimated."""
FEWEST = 1e-3
"""Least degrees of freedom of a variance."""


@dataclass(frozen=True)
class Spread:
    """A variance phi between units, relative to that of the noise, and its degrees of freedom."""

    phi: float = 1.0
    free: float = 0.0

    def pooled(self, usual: Spread) -> Spread:
        """Return this spread combined with the usual one, as far as they agree."""
        if not usual.free > 0.0:
            return self
        agree = min(1.0, f_tail(self.phi / usual.phi, self.free, usual.free) / UNUSUAL_LEVEL)
        more = agree * usual.free
        total = more + self.free
        return Spread(max(self.phi, (more * usual.phi + self.free * self.phi) / total), total)

    def p_value(self, gain: float, degrees: int) -> float:
        """Return the p-value of a gain in twice the log-likelihood by `degrees` degrees of freedom."""
        if self.free < 1.0 or gain <= 0.0:
            return 1.0
        return f_tail(gain / (degrees * max(self.phi, 1e-12)), degrees, self.free)


@dataclass(frozen=True)
class ByUnit:
    """For each unit that a candidate changes, |x_i|^2 and the inner product of x_i with the unit's residual.

    The part c x of the residual that all units share is subtracted. It is 0 at a least-squares optimum; where a
    candidate changes the variance of predictions too, it is not.

    Attributes
    ----------
    sizes, along
        Shape (units,).
    """

    sizes: np.ndarray
    along: np.ndarray

    @classmethod
    def of(cls, moved: np.ndarray, residual: np.ndarray, parts: Sequence[Linearized]) -> ByUnit:
        """Return the products of vectors over all rows of some trials, end to end."""
        cuts = units(parts)
        sizes = np.array([float(moved[c] @ moved[c]) for c in cuts])
        return cls.of_products(sizes, np.array([float(moved[c] @ residual[c]) for c in cuts]))

    @classmethod
    def of_products(cls, sizes: np.ndarray, along: np.ndarray) -> ByUnit:
        """Return the units that a candidate changes, from the products of all units, shape (units,) each."""
        along = along - sizes * (along.sum() / max(float(sizes.sum()), 1e-300))
        felt = sizes > UNFELT * max(float(sizes.max()), 1e-300)
        return cls(sizes[felt], along[felt])

    def spread(self, fitted: int) -> Spread:
        """Return phi with equal weights of units, where `fitted` parameters are fitted."""
        free = len(self.sizes) - fitted
        return Spread(float(np.sum(self.along**2 / self.sizes)) / free, free) if free > 0 else Spread()

    def clustered(self) -> Spread:
        """Return phi with each unit's share of the gain as its weight, corrected for its leverage on the estimate.

        The fewer units carry the gain, the fewer degrees of freedom it has. Source: Bell and McCaffrey, Survey
        Methodology 28 (2002).
        """
        shares = self.sizes / self.sizes.sum()
        weights = shares / np.maximum(1.0 - shares, 1e-9)
        others = np.eye(len(shares)) - np.sqrt(np.outer(shares, shares))
        form = others * weights @ others
        phi = float(np.sum(weights * self.along**2 / np.maximum(self.sizes, 1e-300)))
        return Spread(phi, float(np.trace(form) ** 2 / np.sum(form**2)))


def units(parts: Sequence[Linearized]) -> list[slice]:
    """Return the rows of each unit of evidence: a trial, or a piece of one where trials are few."""
    pieces = 1 if len(parts) >= FEWEST_TRIALS else -(-MIN_UNITS // len(parts))
    rows = slices(len(p.residual) for p in parts)
    cuts = [np.linspace(own.start, own.stop, pieces + 1).round().astype(int) for own in rows]
    return [slice(int(a), int(b)) for cut in cuts for a, b in itertools.pairwise(cut)]


def usual_spread(spreads: Sequence[Spread], most: float) -> Spread:
    """Return the usual spread among the candidates of a library.

    Parameters
    ----------
    spreads
        Spreads of every form of every candidate.
    most
        Most degrees of freedom: the number of candidates.
    """
    known = np.array([(s.phi, s.free) for s in spreads if s.free > 0.0 and s.phi > 0.0])
    if len(known) < 2:
        return Spread()
    phi, half = known[:, 0], 0.5 * known[:, 1]
    logs = np.log(phi) - special.digamma(half) + np.log(half)
    free = _degrees(float(logs.var(ddof=1) - np.mean(special.polygamma(1, half))), most)
    shift = special.digamma(0.5 * free) - np.log(0.5 * free)
    return Spread(float(np.exp(logs.mean() + shift)), free)


def _degrees(variance: float, most: float) -> float:
    """Return the degrees of freedom f0 of a variance whose logarithm has the variance trigamma(f0 / 2)."""

    def missing(degrees: float) -> float:
        return float(special.polygamma(1, 0.5 * degrees)) - variance

    if missing(most) >= 0.0:
        return most
    return float(optimize.brentq(missing, FEWEST, most)) if missing(FEWEST) > 0.0 else FEWEST
