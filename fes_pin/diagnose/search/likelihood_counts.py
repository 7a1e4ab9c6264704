"""Gains of larger sets where readings in counts are taken for the intervals that these stand for.

A count as a number with an error is what the search goes by: it is quick, and leads there from afar. But the error of a
count that stands or hunts is no noise, and causes that hold a rig explain it. As intervals counts tell that they stand.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from fes_pin.data.counts import count_of
from fes_pin.data.trial import Trial
from fes_pin.diagnose.search.likelihood_maxima import LikelihoodMaxima
from fes_pin.identify.fit import PARAMETER_PRICE, Fit
from fes_pin.models.rigs.base import Rig


class LikelihoodCounts:
    """The same fits with counts as intervals.

    Parameters
    ----------
    maxima
        Fits of single models.
    rig
        Whose readings are in counts, or not.
    trials
        What was measured.
    """

    def __init__(self, maxima: LikelihoodMaxima, rig: Rig, trials: Sequence[Trial]) -> None:
        self._maxima = maxima
        self.are_there = any(count_of(t[n]) for t in trials for n in rig.outputs(t.kind) if n in t.columns)
        self._known: dict[int, tuple[Fit, Fit]] = {}
        self._gains: dict[tuple[int, int], float] = {}

    def gained(self, larger: Fit, smaller: Fit) -> float:
        """By how much a larger set lowers the cost of intervals.

        Each begins also where the other ends: the larger one with nothing of what it has besides, so that it is no
        worse, and the smaller one so that what it is worse by is not a fit that ended early.
        """
        pair = (id(larger), id(smaller))
        if pair not in self._gains:
            less, more = self.of(smaller), self.of(larger)
            if more.sse > less.sse:
                more = self._better(larger, {**_nothing(larger), **less.values}, less)
            elif less.sse - more.sse > PARAMETER_PRICE:
                less = self._better(smaller, more.values, more)
            self._gains[pair] = less.sse - more.sse
        return self._gains[pair]

    def of(self, fitted: Fit) -> Fit:
        """The maximum from where a fit has ended, or from elsewhere if that was better."""
        if self._known.get(id(fitted), (None,))[0] is not fitted:
            assert fitted.doubt is not None
            doubt = replace(fitted.doubt, in_counts=True, lasts_s=0.0)
            self._known[id(fitted)] = (fitted, self._maxima.from_start(fitted.model, doubt, fitted.unknowns))
        return self._known[id(fitted)][1]

    def _better(self, fitted: Fit, values: Mapping[str, float], other: Fit) -> Fit:
        """The maximum also from given values, beside what is random in another fit."""
        assert other.doubt is not None
        model = fitted.model.with_parameters({n: v for n, v in values.items() if n in fitted.values})
        begun = self._maxima.from_start(model, other.doubt, other.unknowns)
        self._known[id(fitted)] = (fitted, min((self.of(fitted), begun), key=lambda f: f.sse))
        return self.of(fitted)


def _nothing(fitted: Fit) -> dict[str, float]:
    """The amplitudes of the causes of a fit at their nulls."""
    info = fitted.model.parameter_info()
    names = [f"{e.name}.{n}" for e in fitted.model.effects for n in e.amplitudes()]
    return {n: float(null) for n in names if n in info and (null := info[n].null) is not None}
