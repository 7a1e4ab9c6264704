"""What is claimed of a change: against the noise, against the spread between trials, over the whole library.

x_i is what the larger of two sets adds to trial i, r_i what it leaves there; x_i' r_i / |x_i| has a variance phi, 1
where repeats differ by their noise alone. phi is estimated with the trials' shares of the gain as weights; fewer than
six trials are cut into pieces, which know less of how repeats differ. Few trials tell little of it along one x, but
they tell it along every cause of the library: with ln phi scattered among those no more than f degrees of freedom would
have it, phi is one and the same for all; else so many degrees f0 stand behind the usual phi0 as that scatter leaves.
Both together are

    phi = max(phi, (f0 phi0 + f phi) / (f0 + f)),

f0 less the more significantly phi is above phi0, and gain / (degrees phi) is compared with Fisher's F of f0 + f. Of
the scatter of repeats few trials tell little as well: where a share q of the gain rests on it, the degrees are
1 / (1 / (f0 + f) + q^2 / f).
Sources: Smyth, Stat. Appl. Genet. Mol. Biol. 3 (2004), article 3, sections 3 and 6.2; for q Satterthwaite, Biometrics
Bulletin 2 (1946).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import optimize, special

from fes_pin.contrasts.grouped import Grouped
from fes_pin.contrasts.repeats import Repeats
from fes_pin.contrasts.screen import ItemScore, by_unit
from fes_pin.infer.distributions import f_tail
from fes_pin.infer.levels import UNUSUAL_LEVEL

FEWEST = 1e-3
"""Degrees of freedom of a variance, at least."""


@dataclass(frozen=True)
class Spread:
    """A variance between trials in units of what the noise explains, and the degrees of freedom behind it."""

    phi: float
    free: float

    def pooled(self, usual: Spread) -> Spread:
        """What this and the usual spread say together, as far as they agree."""
        if not usual.free > 0.0:
            return self
        agree = min(1.0, f_tail(self.phi / usual.phi, self.free, usual.free) / UNUSUAL_LEVEL)
        more = agree * usual.free
        total = more + self.free
        return Spread(max(self.phi, (more * usual.phi + self.free * self.phi) / total), total)


def between_trials(larger: Grouped, smaller: Grouped, degrees: int, usual: Spread) -> float:
    """p-value of a gain against its spread between trials.

    Parameters
    ----------
    larger, smaller
        Sets under the same weights.
    degrees
        Of freedom that the larger has more.
    usual
        Spread that is usual among the causes of the library; see `usual_spread`.
    """
    spread, gain = inflation(larger, smaller, usual), smaller.sse - larger.sse
    if spread.free < 1 or gain <= 0.0:
        return 1.0
    return float(f_tail(gain / (degrees * max(spread.phi, 1e-12)), degrees, spread.free))


def inflation(larger: Grouped, smaller: Grouped, usual: Spread) -> Spread:
    """phi together with what is usual in the library; the mean of all trials and that of one group are fitted."""
    left = np.concatenate([p.residual for p in larger.fit.parts])
    moved = np.concatenate([p.residual for p in smaller.fit.parts]) - left
    sizes, along, felt = by_unit(moved, left, larger.fit.parts)
    free = int(felt.sum()) - 1 - max(1, len(larger.changes))
    if free < 1:
        return Spread(1.0, free)
    both = _clustered(sizes, along).pooled(usual)
    share = _leaning(larger, moved) / float(sizes.sum())
    return Spread(both.phi, 1.0 / (1.0 / both.free + share**2 / free))


def _clustered(sizes: np.ndarray, along: np.ndarray) -> Spread:
    """phi with each trial's share of the gain as its weight, corrected for what the trial itself has drawn the change
    to; fewer degrees of freedom the fewer trials carry it. Source: Bell and McCaffrey, Survey Methodology 28 (2002).
    """
    shares = sizes / sizes.sum()
    weights = shares / np.maximum(1.0 - shares, 1e-9)
    others = np.eye(len(shares)) - np.sqrt(np.outer(shares, shares))
    form = others * weights @ others
    return Spread(
        float(np.sum(weights * along**2 / np.maximum(sizes, 1e-300))), float(np.trace(form) ** 2 / np.sum(form**2))
    )


def _leaning(one: Grouped, moved: np.ndarray) -> float:
    """What of the squares that move the trials rests on how much repeats scatter."""
    pieces = np.split(moved, np.cumsum([len(p.residual) for p in one.fit.parts])[:-1])
    total, at = 0.0, 0
    for weight in one.weights.values():
        if isinstance(weight, Repeats):
            total += weight.leaning(pieces[at : at + len(weight.along)])
            at += len(weight.along)
    return total


def usual_spread(scored: Sequence[ItemScore]) -> Spread:
    """The spread that is usual among the causes of a library; no more degrees stand behind it than it has causes."""
    told = np.array([(s.spread, s.spread_degrees) for s in scored if s.spread_degrees > 0 and s.spread > 0.0])
    if len(told) < 2:
        return Spread(1.0, 0.0)
    phi, half = told[:, 0], 0.5 * told[:, 1]
    logs = np.log(phi) - special.digamma(half) + np.log(half)
    free = _degrees(float(logs.var(ddof=1) - np.mean(special.polygamma(1, half))), len({s.item.name for s in scored}))
    shift = special.digamma(0.5 * free) - np.log(0.5 * free)
    return Spread(float(np.exp(logs.mean() + shift)), free)


def _degrees(variance: float, most: float) -> float:
    """Degrees of freedom f0 of a variance whose logarithm has trigamma(f0 / 2) as its own."""

    def missing(degrees: float) -> float:
        return float(special.polygamma(1, 0.5 * degrees)) - variance

    if missing(most) >= 0.0:
        return most
    return float(optimize.brentq(missing, FEWEST, most)) if missing(FEWEST) > 0.0 else FEWEST
