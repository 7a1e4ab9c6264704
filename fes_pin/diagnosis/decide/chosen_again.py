"""Stability of the choice: the set of causes that would have been chosen without some of the trials.

For each set the cost of the other trials is known to second order about its fit to all trials. With g and H the slope
and the curvature of half that cost, each trial's own unknowns eliminated,

    cost(others) = |r|^2 - g' H^-1 g

is the cost after one Gauss-Newton step. A fit by the likelihood takes filter gains as constant in its slopes. The gain
that these predict even for all trials together is therefore subtracted: no step of the fit reached it. Sets are
compared by the rule of the search: the set of lowest criterion of a size replaces the best smaller one if it improves
the likelihood significantly. The held-out trials are not used. The cost of the others is scaled to the number of all
trials, since the question is whether they favour the same set, not whether fewer trials are as significant.

Source: Stone, Cross-validatory choice and assessment of statistical predictions, J. R. Stat. Soc. B 36 (1974);
Giordano, Stephenson, Liu, Jordan and Broderick, A Swiss army infinitesimal jackknife, AISTATS 2019.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.covariance import least_squares_step
from fes_pin.infer.fits import Names
from fes_pin.infer.levels import PARAMETER_PENALTY
from fes_pin.infer.problem import normal_equations
from fes_pin.infer.scatter import at_rest
from fes_pin.infer.scoring import LITTLE


@dataclass(frozen=True)
class _Trial:
    """Number of readings of a trial, and its part of a fit's cost, of half its slope and of half its curvature."""

    readings: int
    cost: float
    slope: np.ndarray
    curvature: np.ndarray


class ChosenAgain:
    """Choice among sets that are fitted to the same trials.

    Parameters
    ----------
    fits
        Fits by the names of their causes; the nominal model has none.
    improves
        Rule of the search: whether a set improves on a smaller one by a gain in twice the log-likelihood, where all its
        causes together have another gain.
    """

    def __init__(
        self,
        fits: Mapping[Names, LikelihoodFit],
        improves: Callable[[LikelihoodFit, LikelihoodFit, float, float], bool],
    ) -> None:
        self._fits = {n: f for n, f in fits.items() if math.isfinite(f.sse)}
        self._improves = improves
        self._trials = {n: _by_trial(f) for n, f in self._fits.items()}

    def without(self, held: Sequence[int]) -> LikelihoodFit:
        """Return the fit to all trials of the set that is chosen without some of them."""
        costs = {n: self._cost(n, held) for n in self._fits}
        best: Names = ()
        for size in sorted({len(n) for n in costs} - {0}):
            of_size = [n for n in costs if len(n) == size]
            first = min(of_size, key=lambda n: (costs[n] + PARAMETER_PENALTY * self._fits[n].degrees, n))
            sets = self._fits[first], self._fits[best]
            if self._improves(*sets, costs[best] - costs[first], costs[()] - costs[first]):
                best = first
        return self._fits[best]

    def _cost(self, names: Names, held: Sequence[int]) -> float:
        """Return the cost of the other trials after one step, scaled to the number of all trials."""
        every = self._trials[names]
        others = [t for i, t in enumerate(every) if i not in held]
        many = sum(t.readings for t in every) / sum(t.readings for t in others)
        (slope, curvature, step), (_, _, kept) = _step(others), _step(every)
        gained = float(slope @ step - 2.0 * slope @ kept + kept @ curvature @ kept)
        return many * (sum(t.cost for t in others) - gained)


def _step(trials: Sequence[_Trial]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return slope and curvature of half the cost of some trials, and the Gauss-Newton step to subtract."""
    slope, curvature = np.sum([t.slope for t in trials], axis=0), np.sum([t.curvature for t in trials], axis=0)
    return slope, curvature, least_squares_step(curvature, slope, rcond=1e-12)


def _by_trial(fitted: LikelihoodFit) -> list[_Trial]:
    """Return each trial's part, of the parameters that are not at a bound."""
    moving = [k for k, n in enumerate(fitted.free) if n not in fitted.at_bound]
    has_ended = fitted.together and fitted.gradient_norm < LITTLE
    each = [(p, normal_equations([p])) for p in (at_rest(fitted.parts) if has_ended else fitted.parts)]
    return [
        _Trial(
            len(p.residual),
            e.sse - e.local_gain + p.log_determinant,
            e.gradient[moving],
            e.hessian[np.ix_(moving, moving)],
        )
        for p, e in each
    ]


def share_of(chosen: Sequence[LikelihoodFit], names: Sequence[str]) -> tuple[int, int] | None:
    """Return in how many folds a cause or an equivalent of it was chosen, and the number of folds; None without."""
    found = sum(any(e.name in names for e in fitted.model.effects) for fitted in chosen)
    return (found, len(chosen)) if chosen else None


def is_chosen(share: tuple[int, int] | None) -> bool:
    """Return False if most folds choose another set: the choice then rests on a few trials.

    Source: Meinshausen and Buehlmann, Stability selection, J. R. Stat. Soc. B 72 (2010).
    """
    return share is None or 2 * share[0] >= share[1]
