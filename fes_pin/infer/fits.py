"""Fits of sets of candidates by their names: extended, converged, ranked, with what most front ends answer a search."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, Self, TypeVar

from fes_pin.infer.family import Family
from fes_pin.infer.levels import CLAIM_LEVEL, SEPARABLE
from fes_pin.infer.search import Fitted, Names

F = TypeVar("F", bound=Fitted)
S = TypeVar("S")


@dataclass(frozen=True)
class Candidate(Generic[S]):
    """A candidate that a set may be extended by.

    Attributes
    ----------
    gain
        In twice the log-likelihood, by the score test; 0 where none is made.
    start
        Where a fit with it begins.
    """

    gain: float
    start: S


class FittedSets(ABC, Generic[F, S]):
    """Fits of sets of candidates to the same data; a front end says how they are made.

    Methods that are not abstract suit linear models, of which each fit has converged.

    Attributes
    ----------
    fits
        By names in alphabetical order; `()` is the nominal model.
    most_candidates
        Candidates in a set, at most; None for no bound.
    converged_sets
        Best sets of a size that go on until they converge.
    family
        Of the tests of all candidates.
    """

    most_candidates: int | None = 3
    converged_sets = 4
    family: Family

    def __init__(self) -> None:
        self.fits: dict[Names, F] = {}
        self._converged: set[Names] = set()
        self._begun: set[tuple[Names, Hashable]] = set()

    @property
    def own(self) -> Self:
        """These models, by the type that their front end knows."""
        return self

    @abstractmethod
    def candidates(self, base: F) -> Mapping[str, Candidate[S]]:
        """Candidates that a set may be extended by."""

    @abstractmethod
    def begin(self, base: F, starts: Mapping[Names, S]) -> Mapping[Names, F]:
        """First fits of sets that extend a base, each from its start."""

    @abstractmethod
    def without(self, names: Names, name: str) -> F:
        """The fit of a set less one candidate."""

    def noise_p_value(self, gain: float, degrees: int) -> float:
        """Family-wise p-value of a gain in twice the log-likelihood against the noise."""
        return self.family.p_value(gain, degrees)

    def pairs(self, most: int) -> Mapping[Names, S]:
        """Starts of the pairs of candidates of largest joint score in the nominal model."""
        return {}

    def converged(self, fits: Sequence[F]) -> list[F]:
        """Fits once they have converged."""
        return list(fits)

    def step_gain(self, fitted: F) -> float:
        """What a further step of a fit gains, by its slope and curvature."""
        return 0.0

    def form_of(self, fitted: F) -> frozenset[Hashable]:
        """In which form a fit has its candidates, where they have several."""
        return frozenset()

    def is_possible(self, fitted: F) -> bool:
        """Whether every size of a fit is physically possible."""
        return True

    def excess_scatter(self, larger: F, smaller: F) -> float:
        """How much more a gain scatters between pieces of the data than the likelihood says; 1 where it does not."""
        return 1.0

    def p_value(self, larger: F, smaller: F, gain: float | None = None) -> float:
        """Family-wise p-value of what a larger set gains, or of a gain in its place, as far as pieces agree on it."""
        gain = smaller.sse - larger.sse if gain is None else gain
        return self.noise_p_value(gain / self.excess_scatter(larger, smaller), more_degrees(larger, smaller))

    def extension_p_value(self, fitted: F) -> float:
        """Family-wise p-value of the score of the best further candidate; 0 where every candidate is fitted."""
        return 0.0

    def level(self, fitted: F) -> float:
        """Family-wise level of a claim."""
        return CLAIM_LEVEL

    def is_error_of_form(self, larger: F, gain: float, explained: float) -> bool:
        """Whether a gain is no more than an error in the form of the other candidates leaves of what all explain."""
        return False

    def predicts_better(self, larger: F, smaller: F) -> bool:
        """Whether what a set adds lessens the errors of prediction."""
        return True

    def leaves_noise(self, fitted: F) -> bool:
        """Whether no lack of fit is found."""
        return True

    def better_form(self, fitted: F) -> F | None:
        """The same set in another form that the data demand; None where they demand none."""
        return None

    def other_form(self, fitted: F) -> F | None:
        """The same set in a form that was reached another way, where that is better."""
        return None

    def begin_again(self, names: Names) -> bool:
        """Fit a set and the nominal model under the noise that the set leaves; False where every fit has its own."""
        return False

    def extend(self, base: Names, most: int | None = None) -> None:
        """Fit a set with each further candidate, or with the `most` of largest score.

        A set that is fitted begins once more where candidates of the base have another form than they have in it.
        """
        fitted = self.fits[base]
        known, forms = self.candidates(fitted), self.form_of(fitted)
        chosen = sorted(known, key=lambda n: (-known[n].gain, n))[:most]
        starts = {tuple(sorted((*base, n))): known[n].start for n in chosen}
        missing = {k: s for k, s in starts.items() if (k, forms) not in self._begun and not self._has(k, forms)}
        self._begun.update((k, forms) for k in missing)
        self._add(fitted, missing)

    def extend_by_pairs(self, most: int) -> None:
        """Fit the pairs of candidates of largest joint score in the nominal model that are not fitted yet."""
        self._add(self.fits[()], {k: s for k, s in self.pairs(most).items() if k not in self.fits})

    def _has(self, names: Names, forms: frozenset[Hashable]) -> bool:
        return names in self.fits and forms <= self.form_of(self.fits[names])

    def _add(self, base: F, starts: Mapping[Names, S]) -> None:
        """Begin sets side by side; of several fits of a set that of lowest price stays."""
        for names, best in self.begin(base, starts).items():
            if names not in self.fits or best.criterion < self.fits[names].criterion:
                self.fits[names] = best
                self._converged.discard(names)
        for size in sorted({len(n) for n in starts}):
            self.converge(size)

    def converge(self, size: int, without: Sequence[Names] = ()) -> None:
        """Let the best sets of a size converge, and those near it, but for some."""
        while slow := [n for n in self._hopeful(size, without) if n not in self._converged]:
            self._converge(slow)

    def converge_rivals(self, base: Names, name: str) -> None:
        """Let the sets converge that have another candidate of about the same score in the place of one."""
        gains = {n: c.gain for n, c in self.candidates(self.fits[base]).items()}
        least = gains.get(name, math.inf) - SEPARABLE
        rivals = [tuple(sorted((*base, n))) for n, gain in gains.items() if gain > least]
        self._converge([n for n in rivals if n in self.fits and n not in self._converged])

    def _converge(self, slow: Sequence[Names]) -> None:
        self.fits.update(zip(slow, self.converged([self.fits[n] for n in slow]), strict=True))
        self._converged.update(slow)

    def _hopeful(self, size: int, without: Sequence[Names]) -> list[Names]:
        """The sets of a size that a further step would make the best, and those that come near the best."""
        near, ranked = self.near(size, without), [n for n in self.ranked(size) if n not in without]
        first = sorted(ranked, key=lambda n: self.fits[n].criterion - self._step_gain(n))[: self.converged_sets]
        return [n for n in ranked if n in first or n in near]

    def _step_gain(self, names: Names) -> float:
        return 0.0 if names in self._converged else self.step_gain(self.fits[names])

    def near(self, size: int, without: Sequence[Names] = ()) -> list[Names]:
        """Sets of a size, best first, that gain half of what the best gains over the best smaller set; the best."""
        ranked = [n for n in self.ranked(size) if n not in without]
        if not ranked:
            return []
        smaller = self.fits[self.ranked(size - 1)[0]].criterion if size else math.inf
        half = 0.5 * (smaller + self.fits[ranked[0]].criterion)
        return [n for n in ranked if n == ranked[0] or self.fits[n].criterion < half]

    def ranked(self, size: int) -> list[Names]:
        """Sets of a size, lowest price first; those that have converged to what cannot be come last."""
        absurd = {n for n in self._converged if not self.is_possible(self.fits[n])}
        return sorted((n for n in self.fits if len(n) == size), key=lambda n: (n in absurd, self.fits[n].criterion, n))


def more_degrees(larger: Fitted, smaller: Fitted) -> int:
    """Degrees of freedom that a larger set has more, at least 1."""
    return max(larger.degrees - smaller.degrees, 1)
