"""Stability of the choice: the set of causes that would have been chosen without some of the trials.

For each set the cost of the other trials is known to second order about its fit to all trials (`infer.left_out`).
Sets are compared by the rule of the search: the set of lowest criterion of a size replaces the best smaller one if it
improves the likelihood significantly. The held-out trials are not used. The cost of the others is scaled to the number
of all trials, since the question is whether they favour the same set, not whether fewer trials are as significant.

Source: Stone, Cross-validatory choice and assessment of statistical predictions, J. R. Stat. Soc. B 36 (1974).
"""

import math
from collections.abc import Callable, Mapping, Sequence

from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.fits import Names
from fes_pin.infer.left_out import LeftOut
from fes_pin.infer.levels import PARAMETER_PENALTY


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
        self._trials = {n: LeftOut(f) for n, f in self._fits.items()}

    def without(self, held: Sequence[int]) -> LikelihoodFit:
        """Return the fit to all trials of the set that is chosen without some of them."""
        costs = {n: trials.cost(held) for n, trials in self._trials.items()}
        best: Names = ()
        for size in sorted({len(n) for n in costs} - {0}):
            of_size = [n for n in costs if len(n) == size]
            first = min(of_size, key=lambda n: (costs[n] + PARAMETER_PENALTY * self._fits[n].degrees, n))
            sets = self._fits[first], self._fits[best]
            if self._improves(*sets, costs[best] - costs[first], costs[()] - costs[first]):
                best = first
        return self._fits[best]


def share_of(chosen: Sequence[LikelihoodFit], names: Sequence[str]) -> tuple[int, int] | None:
    """Return in how many folds a cause or an equivalent of it was chosen, and the number of folds; None without."""
    found = sum(any(e.name in names for e in fitted.model.effects) for fitted in chosen)
    return (found, len(chosen)) if chosen else None


def is_chosen(share: tuple[int, int] | None) -> bool:
    """Return False if most folds choose another set: the choice then rests on a few trials.

    Source: Meinshausen and Buehlmann, Stability selection, J. R. Stat. Soc. B 72 (2010).
    """
    return share is None or 2 * share[0] >= share[1]
