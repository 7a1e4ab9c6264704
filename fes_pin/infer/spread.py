"""Gains against their spread between units of evidence, whatever the noise within each.

x_i is what the larger of two models adds to the prediction of unit i, r_i the residual that it has there. The variance
of x_i' r_i / |x_i| is phi, 1 where units differ by their noise alone. It is estimated with the units' shares of the
gain as weights. Few units tell little of it along one x, but they tell it along every candidate of a library: with ln
phi scattered among those no more than f degrees of freedom would have it, phi is one and the same for all; else so
many degrees f0 stand behind the usual phi0 as that scatter leaves. Both together are

    phi = max(phi, (f0 phi0 + f phi) / (f0 + f)),

f0 less the more significantly phi is above phi0, and gain / (degrees phi) is compared with Fisher's F of f0 + f.
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

FEWEST_TRIALS = 6
"""Trials that alone show how much repeats differ; of fewer each is cut into pieces, which know less of that."""
MIN_UNITS = 8
"""Units of evidence that the spread is judged on, at least."""
FEWEST = 1e-3
"""Degrees of freedom of a variance, at least."""


@dataclass(frozen=True)
class Spread:
    """A variance phi between units in units of what the noise explains, and the degrees of freedom behind it."""

    phi: float = 1.0
    free: float = 0.0

    def pooled(self, usual: Spread) -> Spread:
        """What this and the usual spread say together, as far as they agree."""
        if not usual.free > 0.0:
            return self
        agree = min(1.0, f_tail(self.phi / usual.phi, self.free, usual.free) / UNUSUAL_LEVEL)
        more = agree * usual.free
        total = more + self.free
        return Spread(max(self.phi, (more * usual.phi + self.free * self.phi) / total), total)

    def p_value(self, gain: float, degrees: int) -> float:
        """Of a gain in twice the log-likelihood by so many degrees of freedom."""
        if self.free < 1.0 or gain <= 0.0:
            return 1.0
        return f_tail(gain / (degrees * max(self.phi, 1e-12)), degrees, self.free)


@dataclass(frozen=True)
class ByUnit:
    """What moves each unit that is moved, by |x_i|^2, and its inner product with the unit's residual.

    Attributes
    ----------
    sizes, along
        Shape (units,).
    """

    sizes: np.ndarray
    along: np.ndarray

    @classmethod
    def of(cls, moved: np.ndarray, residual: np.ndarray, parts: Sequence[Linearized]) -> ByUnit:
        """Of vectors over all rows of some trials, end to end."""
        cuts = units(parts)
        sizes = np.array([float(moved[c] @ moved[c]) for c in cuts])
        along = np.array([float(moved[c] @ residual[c]) for c in cuts])
        felt = sizes > UNFELT * max(float(sizes.max()), 1e-300)
        return cls(sizes[felt], along[felt])

    def spread(self, fitted: int) -> Spread:
        """phi where so many parameters are fitted, each unit as good as another."""
        free = len(self.sizes) - fitted
        return Spread(float(np.sum(self.along**2 / self.sizes)) / free, free) if free > 0 else Spread()

    def clustered(self) -> Spread:
        """phi with each unit's share of the gain as its weight, corrected for what it has drawn the estimate to itself.

        Fewer degrees of freedom the fewer units carry it. Source: Bell and McCaffrey, Survey Methodology 28 (2002).
        """
        shares = self.sizes / self.sizes.sum()
        weights = shares / np.maximum(1.0 - shares, 1e-9)
        others = np.eye(len(shares)) - np.sqrt(np.outer(shares, shares))
        form = others * weights @ others
        phi = float(np.sum(weights * self.along**2 / np.maximum(self.sizes, 1e-300)))
        return Spread(phi, float(np.trace(form) ** 2 / np.sum(form**2)))


def units(parts: Sequence[Linearized]) -> list[slice]:
    """Rows of each unit of evidence: a trial, or a piece of one where trials are few."""
    pieces = 1 if len(parts) >= FEWEST_TRIALS else -(-MIN_UNITS // len(parts))
    ends = itertools.accumulate((len(p.residual) for p in parts), initial=0)
    cuts = [np.linspace(a, b, pieces + 1).round().astype(int) for a, b in itertools.pairwise(ends)]
    return [slice(int(a), int(b)) for cut in cuts for a, b in itertools.pairwise(cut)]


def usual_spread(spreads: Sequence[Spread], most: float) -> Spread:
    """The spread that is usual among the candidates of a library.

    Parameters
    ----------
    spreads
        Of every form of every candidate.
    most
        Degrees of freedom behind it, at most: no more than there are candidates.
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
    """Degrees of freedom f0 of a variance whose logarithm has trigamma(f0 / 2) as its own."""

    def missing(degrees: float) -> float:
        return float(special.polygamma(1, 0.5 * degrees)) - variance

    if missing(most) >= 0.0:
        return most
    return float(optimize.brentq(missing, FEWEST, most)) if missing(FEWEST) > 0.0 else FEWEST
