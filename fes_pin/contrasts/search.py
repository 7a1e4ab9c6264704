"""The search for what differs: causes common to all groups and changes of one group compete by one price.

A set's price is twice its negative log-likelihood with `PARAMETER_PRICE` for each parameter. A cause that acts in all
groups alike stands in the same list as one that acts in one group, so that a model that is wrong in all groups does not
turn up as a change: of two that explain as much the common one is taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fes_pin.contrasts.decide import noise_p_value, p_value
from fes_pin.contrasts.fits import Fits
from fes_pin.contrasts.grouped import Grouped, Item
from fes_pin.contrasts.promises import Promise
from fes_pin.diagnosis.search.starts import STARTS
from fes_pin.infer.family import Family
from fes_pin.infer.levels import CLAIM_LEVEL, PARAMETER_PRICE, SEPARABLE
from fes_pin.workers import OutOfTime, Progress, in_parallel, time_limit

MOST_ITEMS = 5
"""Common causes and changes together."""
FITTED = 10
"""Items that are fitted beside a set, those of most linear promise."""
FITTED_DRIVEN = 6
"""The same on driven rigs, where a fit is some five times as long and the screen already holds what is random."""
CONVERGED = 3
"""Sets that go on until they converge, those that are cheapest after a few steps."""
SWAPS = 2
"""Rounds in which items may be replaced by better ones."""


@dataclass
class ContrastFound:
    """What a search found.

    Attributes
    ----------
    nominal, best
        Fits: of the nominal model that is the same in all groups, and of the set that was chosen.
    p_values
        Of each change, family-wise.
    without
        The fit without each change, under the weights of `best`.
    rivals
        For each change fits in which another item stood in its place.
    promises
        What all items that the best set does not have would add to it.
    family
        Of tests.
    """

    nominal: Grouped
    best: Grouped
    p_values: dict[Item, float]
    without: dict[Item, Grouped]
    rivals: dict[Item, list[Grouped]]
    promises: list[Promise]
    family: Family


class ContrastSearch:
    """One search on the groups of one study."""

    def __init__(self, fits: Fits, seed: int, progress: Progress) -> None:
        self.fits, self.seed, self.progress = fits, seed, progress

    def run(self) -> ContrastFound:
        """Search as long as the limit of time lets it; the nominal model is fitted and scored anyway."""
        self.progress(0.05, "one model for all groups")
        with time_limit(math.inf):
            nominal = self._kept = self.fits.first()
            promises, scores = self.fits.promises(nominal)
            self.family = scores.family(self.seed)
        try:
            return self._run(nominal, promises)
        except OutOfTime:
            with time_limit(math.inf):
                best = self._dropped(self._kept)
                rests = {i: self.fits.without(best, i) for i in best.changes}
                return self._with_rivals(nominal, best, rests, {i: [] for i in rests})

    def _run(self, nominal: Grouped, promises: list[Promise]) -> ContrastFound:
        """Search forward, swap, take back what is superfluous, under the noise that the set itself leaves."""
        best = self._forward(nominal, promises)
        self.progress(0.6, "swaps")
        best = self._settled(best)
        again = self.fits.under_own_noise(best)
        if not self.fits.driven:
            promises, _ = self.fits.promises(again)
            best = self._settled(self._forward(again, promises))
        self.progress(0.85, "rivals")
        return self._told(nominal, self._in_one(best))

    def _in_one(self, best: Grouped) -> Grouped:
        """A nominal parameter's change in the place of several changes, where it is significant and costs no more.

        A scale of the effort beside other damping and weight is another inertia.
        """
        if len(best.changes) < 2:
            return best
        common = best
        for item in best.changes:
            common = self.fits.without(common, item)
        single = [p for p in self.fits.promises(common)[0] if p.effect is None]
        tried = in_parallel(lambda p: self.fits.go_on(self.fits.look(common, [p])), single)
        cheaper = [
            f for f in tried if f.price < best.price and p_value(self.fits, self.family, f, common) < CLAIM_LEVEL
        ]
        return min(cheaper, key=lambda f: f.price, default=best)

    def _forward(self, base: Grouped, promises: list[Promise]) -> Grouped:
        while len(base.items) < MOST_ITEMS:
            self.progress(0.1 + 0.1 * len(base.items), f"{len(base.items) + 1} beside the nominal model")
            tried = self._beside(base, promises)
            if not tried:
                break
            first = self._first(tried)
            best = self._significant([first, *(f for f in tried[:CONVERGED] if f is not first)], base)
            if best is None:
                best = self._two_at_once(self.fits.refined(first), base) or self._common(tried, base)
            if best is None:
                break
            base = self._kept = self.fits.in_common(best)
            promises, _ = self.fits.promises(base)
        return base

    def _significant(self, tried: list[Grouped], base: Grouped) -> Grouped | None:
        """The first of some sets that is significant; probabilities are those of the whole library.

        What is cheapest may be what single trials differ by, which says nothing of a group, and hides what does.
        """
        for one in tried:
            refined = self.fits.refined(one)
            if p_value(self.fits, self.family, refined, base) < CLAIM_LEVEL:
                return refined
        return None

    def _common(self, tried: list[Grouped], base: Grouped) -> Grouped | None:
        """The cheapest set with a cause of all groups more, as long as no change stands out: it may hide one."""
        common = [f for f in tried if f.items[-1].group is None]
        if base.changes or not common or not noise_p_value(self.family, common[0], base) < CLAIM_LEVEL:
            return None
        return common[0]

    def _two_at_once(self, one: Grouped, base: Grouped) -> Grouped | None:
        """A set with two items more, each significant beside the other, where one alone is not.

        What a second change leaves in the trials of a group makes them differ, and hides the first.
        """
        degrees = max(len(one.fit.free) - len(base.fit.free), 1)
        if (
            len(base.items) + 2 > MOST_ITEMS
            or not self.family.p_value(base.fit.sse - one.fit.sse, degrees) < CLAIM_LEVEL
        ):
            return None
        tried = self._beside(one, self.fits.promises(one)[0])
        if not tried:
            return None
        both = self._first(tried)
        rests = [self.fits.without(both, item) for item in both.items[len(base.items) :]]
        return both if all(p_value(self.fits, self.family, both, rest) < CLAIM_LEVEL for rest in rests) else None

    def _beside(self, base: Grouped, promises: list[Promise], leave: Item | None = None) -> list[Grouped]:
        """Fits of a set with each of the items of most promise beside it, cheapest first.

        That something which the set has already differs in a group is always tried: what is random in the set hides
        how much it would gain.
        """
        ranked: dict[Item, list[Promise]] = {}
        for one in sorted(promises, key=lambda p: PARAMETER_PRICE * p.degrees - p.gain):
            if one.item != leave and one.gain > 1.0:
                ranked.setdefault(one.item, []).append(one)
        most = FITTED_DRIVEN if self.fits.driven else FITTED
        chosen = [many for k, many in enumerate(ranked.values()) if k < most or many[0].effect is None]
        looks = in_parallel(lambda many: self.fits.look(base, many[:STARTS]), chosen)
        looks = sorted((f for f in looks if np.isfinite(f.fit.sse)), key=lambda f: f.price)
        done = in_parallel(self.fits.go_on, looks[:CONVERGED])
        return sorted([*done, *looks[CONVERGED:]], key=lambda f: f.price)

    def _first(self, tried: list[Grouped]) -> Grouped:
        """The cheapest, or a common cause in its place that is as good."""
        best = tried[0]
        for one in tried:
            if one.items[-1].group is None and one.price < best.price + SEPARABLE:
                return one
        return best

    def _settled(self, best: Grouped) -> Grouped:
        """Replace items as long as that helps, then drop those that are not significant."""
        for _ in range(SWAPS if len(best.items) > 1 else 0):
            before = best
            for item in best.items:
                if item not in best.items:
                    continue
                rest = self.fits.without(best, item)
                tried = self._beside(rest, self.fits.promises(rest)[0], item)
                cheaper = (f for f in tried[:CONVERGED] if f.price < best.price - 1.0)
                best = next((f for f in cheaper if self._worth(f.items[-1], f, rest) < CLAIM_LEVEL), best)
            if best is before:
                break
        while best.items:
            without = {i: self.fits.without(best, i) for i in best.items}
            values = {i: self._worth(i, best, w) for i, w in without.items()}
            weakest = max(values, key=lambda i: values[i])
            if values[weakest] < CLAIM_LEVEL:
                break
            best = without[weakest]
        return best

    def _worth(self, item: Item, best: Grouped, without: Grouped) -> float:
        """p-value of an item beside all others: of a common cause against the noise, of a change against both."""
        if item.group is None:
            return noise_p_value(self.family, best, without)
        return p_value(self.fits, self.family, best, without)

    def _told(self, nominal: Grouped, best: Grouped) -> ContrastFound:
        """Every change with its p-value and its rivals; one that a common cause could replace is none.

        Beside less noise than the search began with a rival may have become the better one: it takes the place.
        """
        best = self._dropped(self.fits.in_common(best))
        while True:
            rests, rivals = {i: self.fits.without(best, i) for i in best.changes}, {}
            for item, rest in rests.items():
                rivals[item] = self._tenable(self._beside(rest, self.fits.promises(rest)[0], item), best, rest)
            every = [one for many in rivals.values() for one in many]
            doubtful = [f for f in every if f.items[-1].group is None and f.price < best.price + SEPARABLE]
            better = self._better(best, rivals)
            if not doubtful and better is None:
                break
            best = self._dropped(min(doubtful, key=lambda f: f.price)) if doubtful else better or best
        return self._with_rivals(nominal, best, rests, rivals)

    def _with_rivals(
        self, nominal: Grouped, best: Grouped, rests: dict[Item, Grouped], rivals: dict[Item, list[Grouped]]
    ) -> ContrastFound:
        """A set, from the fits without each of its changes, with the probability and the rivals of each."""
        p_values = {i: p_value(self.fits, self.family, best, rest) for i, rest in rests.items()}
        without = {i: self.fits.weighed_as(rest, best) for i, rest in rests.items()}
        promises, _ = self.fits.promises(best)
        return ContrastFound(nominal, best, p_values, without, rivals, promises, self.family)

    def _tenable(self, rivals: list[Grouped], best: Grouped, rest: Grouped) -> list[Grouped]:
        """Rivals without those that cost as little and are not significant themselves: what single trials differ by."""
        near = best.price + SEPARABLE
        return [f for f in rivals if f.price >= near or self._worth(f.items[-1], f, rest) < CLAIM_LEVEL]

    def _better(self, best: Grouped, rivals: dict[Item, list[Grouped]]) -> Grouped | None:
        """The cheapest set in which a rival stands in a change's place, if it is cheaper."""
        cheaper = [many[0] for many in rivals.values() if many and many[0].price < best.price - 1.0]
        return min(cheaper, key=lambda f: f.price, default=None)

    def _dropped(self, best: Grouped) -> Grouped:
        """The set less the changes that are not significant any more."""
        for item in best.changes:
            rest = self.fits.without(best, item)
            if not p_value(self.fits, self.family, best, rest) < CLAIM_LEVEL:
                return self._dropped(rest)
        return best
