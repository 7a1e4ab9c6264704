"""The set of causes that brings free simulations near to the data, where the nominal model is far from them."""

from typing import Protocol

from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.fits import Names
from fes_pin.infer.levels import MOST_CAUSES, NOTHING_PERCENT, SMALL_SHARE
from fes_pin.infer.search import BEAM, FITTED
from fes_pin.search.library import Library
from fes_pin.search.likelihood_forms import refined_form
from fes_pin.search.possible import is_possible
from fes_pin.workers import in_parallel

MORE = 2.0
"""Ratio of the errors E of two fits above which one is farther from the data."""


class Simulated(Protocol):
    """Fits of sets of causes by least squares of free simulations."""

    fits: dict[Names, LikelihoodFit]
    library: Library

    def nominal(self) -> LikelihoodFit:
        """Fit the nominal model."""

    def extend(self, base: Names, most: int | None = None) -> None:
        """Fit a set with each further cause, or with the `most` of largest score."""

    def without(self, names: Names, name: str) -> LikelihoodFit:
        """Return the fit of a set without one cause."""

    def misfit(self, fitted: LikelihoodFit) -> float:
        """Return E of a fit's free simulations, percent."""

    def is_far(self, fitted: LikelihoodFit) -> bool:
        """Return whether a fit is far from the data."""


def approach(sets: Simulated, least: float = NOTHING_PERCENT) -> Names:
    """Return the smallest set whose E is no more than the least, or the nearest set of at most `MOST_CAUSES`.

    Forms of the sets of several causes that are about as near as the nearest are refined before a further cause is
    tried. Causes that the others came to replace are dropped at the end.
    """
    best: Names = ()
    fits = sets.fits
    sets.nominal()
    while sets.misfit(fits[best]) > least and len(best) < MOST_CAUSES:
        for k, names in enumerate(_nearest(sets, len(best))):
            sets.extend(names, FITTED if k else None)
        larger = _nearest(sets, len(best) + 1, FITTED)
        if best and larger and sets.is_far(fits[larger[0]]):
            near = MORE * sets.misfit(fits[larger[0]])
            in_parallel(lambda n: _refine(sets, n), [n for n in larger if sets.misfit(fits[n]) <= near])
            larger = _nearest(sets, len(best) + 1)
        if not (larger and _is_nearer(sets, fits[larger[0]], fits[best])):
            break
        best = larger[0]
    if best:
        _refine(sets, best)
    return _without_replaced(sets, best, least)


def _without_replaced(sets: Simulated, names: Names, least: float) -> Names:
    """Return a set without each cause that no longer lessens E, or without which E is no more than the least."""
    while len(names) > 1:
        left = {n: sets.without(names, n) for n in names}
        gone = min(names, key=lambda n: sets.misfit(left[n]))
        if sets.misfit(left[gone]) > least and _is_nearer(sets, sets.fits[names], left[gone]):
            break
        names = tuple(n for n in names if n != gone)
    return names


def _is_nearer(sets: Simulated, larger: LikelihoodFit, smaller: LikelihoodFit) -> bool:
    """Return whether a larger set lessens E by a tenth, or an E that is negligible by half."""
    now = sets.misfit(smaller)
    return sets.misfit(larger) <= (now / MORE if now < NOTHING_PERCENT else (1.0 - SMALL_SHARE) * now)


def _nearest(sets: Simulated, size: int, count: int = BEAM) -> list[Names]:
    """Return the sets of a size of least E whose causes are physically possible; on the way none may be a model."""
    own = (n for n in sets.fits if len(n) == size)
    possible = [n for n in own if not n or is_possible(sets.fits[n], sets.library.measured)]
    return sorted(possible, key=lambda n: (sets.misfit(sets.fits[n]), n))[:count]


def _refine(sets: Simulated, names: Names) -> None:
    """Replace the fit of a set by that of a refined form where E is half as large."""
    refined = refined_form(sets.fits[names], sets.library.measured)
    if refined is not None and MORE * sets.misfit(refined) < sets.misfit(sets.fits[names]):
        sets.fits[names] = refined
