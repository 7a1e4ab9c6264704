"""The search for sets of causes: every form beside every other, by one likelihood with a price for each parameter."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fes_pin.walk.banks import Banks, Chosen
from fes_pin.walk.effect import Form
from fes_pin.walk.fits import Set, WalkFits
from fes_pin.workers import OutOfTime

BEAM = 4
"""Sets of one size that are carried on."""
MOST = 3
"""Causes in a set, at most."""


class WalkSearch:
    """One diagnosis's search, among the fits of its banks."""

    def __init__(self, banks: Banks) -> None:
        self.banks, self.fits = banks, WalkFits(banks)
        self.kept: list[Set] = []
        self.was_stopped = False

    def run(self) -> list[Set]:
        """The best set of every size, from none on; the channels are rotated anew for what the best one leaves.

        Past the limit of time: of the sizes that were searched to their end.
        """
        try:
            return self._run()
        except OutOfTime:
            self.was_stopped, self.fits.is_limited = True, False
            return self.fits.fit_all([one.forms for one in self.kept])

    def _run(self) -> list[Set]:
        best = self._beam(2)[-1]
        bank = self.banks.bank(best.forms)
        residual = bank.y
        if best.forms:
            found = np.concatenate([bank.x[i] for i in best.forms], axis=3)
            residual = residual - found @ best.fitted.values[: found.shape[3]]
        self.fits.turn(residual)
        return self._beam(MOST)

    def _beam(self, most: int) -> list[Set]:
        self.kept = sizes = [self.fits.fit(())]
        self.fits.is_limited = True
        front = [sizes[0]]
        for _ in range(most):
            seen = {chosen for one in front for chosen in self.extensions(one.forms)}
            ranked = sorted(self.fits.fit_all(seen), key=lambda s: (s.price, s.forms))
            front = self._diverse(ranked)
            sizes.append(self._swapped(ranked[0]))
            if sizes[-1].price > sizes[-2].price:
                break
        return sizes

    def extensions(self, chosen: Chosen) -> Iterator[Chosen]:
        """The set with one more form, of a site that it has not: no two forms of one cause at one site."""
        taken = {_place(self.banks.forms[i]) for i in chosen}
        for i, form in enumerate(self.banks.forms):
            if _place(form) not in taken:
                yield tuple(sorted((*chosen, i)))

    def _diverse(self, ranked: list[Set]) -> list[Set]:
        """The best sets, at most two of the same causes."""
        kept: list[Set] = []
        for one in ranked:
            names = sorted(self.banks.causes(one.forms))
            if sum(sorted(self.banks.causes(k.forms)) == names for k in kept) < 2:
                kept.append(one)
            if len(kept) == BEAM:
                break
        return kept

    def _swapped(self, one: Set) -> Set:
        """The set after every single swap that makes it better."""
        while len(one.forms) > 1:
            better = min((s for _, s in self.swaps(one)), key=lambda s: (s.price, s.forms))
            if better.price >= one.price - 1e-6:
                return one
            one = better
        return one

    def swaps(self, one: Set) -> Iterator[tuple[int, Set]]:
        """Every set in which one form stands in another's place: the form that went, and the set."""
        for gone in one.forms:
            rest = tuple(i for i in one.forms if i != gone)
            others = [chosen for chosen in self.extensions(rest) if chosen != one.forms]
            yield from ((gone, other) for other in self.fits.fit_all(others))


def _place(form: Form) -> tuple[str, str]:
    return form.cause, form.site.split(",")[0]
