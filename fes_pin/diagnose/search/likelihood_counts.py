"""Gains of larger sets where readings in counts are taken for the intervals that these stand for.

A count as a number with an error is what the search goes by: it is quick, and leads there from afar. But the error of a
count that stands or hunts is no noise, and causes that hold a rig explain it. As intervals counts tell that they stand.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Generic, TypeVar

from fes_pin.data.counts import count_of
from fes_pin.data.trial import Trial
from fes_pin.identify.fit import Fit
from fes_pin.identify.levels import PARAMETER_PRICE
from fes_pin.models.predictor import Doubt
from fes_pin.models.rigs.base import Rig

CauseSet = TypeVar("CauseSet")
"""A set of causes that is fitted: a `Fit`, or one of several groups."""


class LikelihoodCounts(Generic[CauseSet]):
    """The same sets with counts as intervals.

    Parameters
    ----------
    rig
        Whose readings are in counts, or not.
    trials
        What was measured.
    fit_of
        The fit of a set.
    maximum
        The maximum of a set from values by path and what is random in another; its own where that is None. Counts are
        intervals there.
    """

    def __init__(
        self,
        rig: Rig,
        trials: Sequence[Trial],
        fit_of: Callable[[CauseSet], Fit],
        maximum: Callable[[CauseSet, Mapping[str, float], CauseSet | None], CauseSet],
    ) -> None:
        self._fit_of, self._maximum = fit_of, maximum
        self.are_there = any(count_of(t[n]) for t in trials for n in rig.outputs(t.kind) if n in t.columns)
        self._known: dict[int, tuple[CauseSet, CauseSet]] = {}
        self._gains: dict[tuple[int, int], float] = {}

    def gained(self, larger: CauseSet, smaller: CauseSet) -> float:
        """By how much a larger set lowers the cost of intervals.

        Each begins also where the other ends: the larger one with nothing of what it has besides, so that it is no
        worse, and the smaller one so that what it is worse by is not a fit that ended early.
        """
        pair = (id(larger), id(smaller))
        if pair not in self._gains:
            less, more = self._fit_of(self.of(smaller)), self._fit_of(self.of(larger))
            if more.sse > less.sse:
                more = self._better(larger, beside(self._fit_of(larger), less.values), smaller)
            elif less.sse - more.sse > PARAMETER_PRICE:
                less = self._better(smaller, more.values, larger)
            self._gains[pair] = less.sse - more.sse
        return self._gains[pair]

    def of(self, one: CauseSet) -> CauseSet:
        """The maximum from where a set has ended, or from elsewhere if that was better."""
        if self._known.get(id(one), (None,))[0] is not one:
            self._known[id(one)] = (one, self._maximum(one, {}, None))
        return self._known[id(one)][1]

    def _better(self, one: CauseSet, values: Mapping[str, float], other: CauseSet) -> Fit:
        """The maximum of a set also from given values, beside what is random in another."""
        begun = self._maximum(one, values, self.of(other))
        self._known[id(one)] = (one, min((self.of(one), begun), key=lambda s: self._fit_of(s).sse))
        return self._fit_of(self.of(one))


def in_counts(doubt: Doubt) -> Doubt:
    """The same doubt of readings whose counts stand for intervals."""
    return replace(doubt, in_counts=True, lasts_s=0.0)


def beside(larger: Fit, values: Mapping[str, float]) -> dict[str, float]:
    """Values of a smaller set as those of a larger one, with nothing of what that has besides.

    What differs in a group alone (path@group) is there as it is in all.
    """
    info, out = larger.model.parameter_info(), dict(values)
    for path in larger.values:
        common, one = path.partition("@")[0], info[path]
        if path not in values and common in values:
            out[path] = values[common]
        elif path not in values and one.null is not None and not one.optional:
            out[path] = float(one.null)
    return out


__all__ = ["LikelihoodCounts", "beside", "in_counts"]
