"""Fits of sets of candidates by their names: extended, converged and ranked, with defaults for most front ends."""

import math
from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from fes_pin.infer.family import Family
from fes_pin.infer.keys import Key
from fes_pin.infer.levels import CLAIM_LEVEL, FORM_SHARE, MOST_CAUSES, SEPARABLE
from fes_pin.infer.optimize import WORTH

Names = tuple[str, ...]
"""Names of the candidates of a set, in alphabetical order."""


class Fitted(Protocol):
    """A fit of a set of candidates."""

    @property
    def sse(self) -> float:
        """Twice the negative log-likelihood, up to a constant."""

    @property
    def criterion(self) -> float:
        """The same with a penalty for each degree of freedom."""

    @property
    def degrees(self) -> int:
        """Degrees of freedom."""


CONVERGED = 4
"""Best sets of a size that are fitted until they converge."""

F = TypeVar("F", bound=Fitted)
S = TypeVar("S")


class Sets(ABC, Generic[F]):
    """Fits of sets of candidates to the same data, which a front end makes.

    The methods that are not abstract suit linear models, whose fits have all converged.

    Attributes
    ----------
    fits
        Fits by names in alphabetical order; `()` is the nominal model.
    most_candidates
        Most candidates in a set; None for no bound.
    acts_at_all
        Whether a candidate may act at all of its sites, as friction does at joints. It then counts as one.
    converged_sets
        Number of best sets of a size that are fitted until they converge.
    family
        Family of the tests of all candidates.
    """

    most_candidates: int | None = MOST_CAUSES
    acts_at_all = True
    converged_sets = CONVERGED
    family: Family

    def __init__(self) -> None:
        self.fits: dict[Names, F] = {}
        self._converged: set[Names] = set()
        self._begun: set[tuple[Names, Hashable]] = set()

    @property
    def estimator(self) -> str:
        """How sets are fitted, in words."""
        return "likelihood"

    @abstractmethod
    def nominal(self) -> F:
        """Fit the nominal model and the family of tests; raise an error where the fit is not finite."""

    @abstractmethod
    def extend(self, base: Names, most: int | None = None) -> None:
        """Fit a set with each further candidate, or with the `most` of largest score."""

    @abstractmethod
    def without(self, names: Names, name: str) -> F:
        """Return the fit of a set without one candidate."""

    def is_within(self, names: Names) -> bool:
        """Return whether a set has no more candidates than `most_candidates`."""
        kinds = {Key.of(n)._replace(site="") if self.acts_at_all else Key.of(n) for n in names}
        return self.most_candidates is None or len(kinds) <= self.most_candidates

    def has_room(self, names: Names) -> bool:
        """Return whether a set may be extended by a further candidate, or by one of its own at another site."""
        return self.is_within((*names, "")) or (self.acts_at_all and any(Key.of(n).site for n in names))

    def first(self) -> Names:
        """Return the fitted set that a search begins with: the nominal model, or one nearer to the data."""
        return ()

    def noise_p_value(self, gain: float, degrees: int) -> float:
        """Return the family-wise p-value of a gain in twice the log-likelihood against the noise."""
        return self.family.p_value(gain, degrees)

    def converged(self, fits: Sequence[F]) -> list[F]:
        """Return the converged fits."""
        return list(fits)

    def step_gain(self, fitted: F) -> float:
        """Return the gain of a further step of a fit by its slope and curvature."""
        return 0.0

    def is_possible(self, fitted: F) -> bool:
        """Return whether every size of a fit is physically possible."""
        return True

    def is_a_model(self, fitted: F) -> bool:
        """Return whether a fit is better than a constant, with every nominal parameter off its bounds."""
        return True

    def is_certain(self, fitted: F, name: str) -> bool:
        """Return whether the size of a candidate of a fit is twice its deviation."""
        return True

    def equivalents(self, best: F, without: F, rivals: Sequence[F]) -> list[F]:
        """Return the rivals in the place of a candidate that the data do not distinguish from it.

        The criterion chooses which is named, the likelihood which are equivalent: a rival that fits as well with more
        parameters, as a spring in the place of a constant torque, is not excluded.

        Parameters
        ----------
        without
            The best set without the candidate.
        """
        leads = (min(r.criterion - best.criterion, r.sse - best.sse) for r in rivals)
        each = zip(rivals, leads, strict=True)
        return [r for r, lead in each if not self.is_distinguished(best, without, r, lead)]

    def is_distinguished(self, best: F, without: F, rival: F, lead: float) -> bool:
        """Return whether the lead of the best set in twice the log-likelihood excludes a rival."""
        return lead >= SEPARABLE

    def is_claimed(self, name: str) -> bool:
        """Return whether a candidate of the best set is a claim, for which rivals are searched."""
        return True

    def excess_scatter(self, larger: F, smaller: F) -> float:
        """Return the ratio of a gain's scatter between pieces of the data to that of the likelihood; at least 1."""
        return 1.0

    def p_value(self, larger: F, smaller: F, gain: float | None = None) -> float:
        """Return the family-wise p-value of the gain of a larger set, or of a given gain, corrected for scatter."""
        gain = smaller.sse - larger.sse if gain is None else gain
        return self.noise_p_value(gain / self.excess_scatter(larger, smaller), more_degrees(larger, smaller))

    def extension_p_value(self, fitted: F) -> float:
        """Return the family-wise p-value of the best further candidate's score; 0 where every candidate is fitted."""
        return 0.0

    def level(self, fitted: F) -> float:
        """Return the family-wise level of a claim."""
        return CLAIM_LEVEL

    def is_error_of_form(self, larger: F, gain: float, explained: float) -> bool:
        """Return whether a gain is no more than an error in the form of the other candidates may leave."""
        return False

    def predicts_better(self, larger: F, smaller: F) -> bool:
        """Return whether a larger set has smaller errors of prediction."""
        return True

    def leaves_noise(self, fitted: F) -> bool:
        """Return whether a fit has no lack of fit."""
        return True

    def better_form(self, fitted: F) -> F | None:
        """Return the same set in another form that is significant; None where none is."""
        return None

    def begin_again(self, names: Names) -> bool:
        """Fit a set and the nominal model with another kind of noise; return False where none lowers the criterion."""
        return False

    def converge(self, size: int, without: Sequence[Names] = ()) -> None:
        """Fit the best sets of a size, and those near the best, until they converge, except some."""
        while slow := [n for n in self._hopeful(size, without) if n not in self._converged]:
            self.converge_these(slow)

    def under_noise_of(self, other: F, fits: Sequence[F]) -> Sequence[F]:
        """Return fits, with their parameters, under the noise of another fit of the same data."""
        return fits

    def converge_rivals(self, names: Names, name: str) -> None:
        """Converge the sets that another candidate in the place of one brings near, by a further step under one noise.

        Near is half of what the candidate itself explains. A first fit of a set is made under the noise of a smaller
        set, which takes up what a candidate would explain: rivals of a converged set are compared under its noise, and
        begin with that where their own is less likely.
        """
        rest, whole = tuple(n for n in names if n != name), self.fits[names]
        rivals = [k for k in self.fits if len(k) == len(names) and set(rest) < set(k) and k != names]
        if not rivals:
            return
        less, *fits = self.under_noise_of(whole, [self.fits[rest], *(self.fits[k] for k in rivals)])
        under = dict(zip(rivals, fits, strict=True))
        likelier = {k: f for k, f in under.items() if f.criterion < self.fits[k].criterion - WORTH}
        self.fits.update(likelier)
        self._converged -= set(likelier)
        half, slow = 0.5 * (less.criterion + whole.criterion), [k for k in rivals if k not in self._converged]
        self.converge_these([k for k in slow if under[k].criterion - self.step_gain(under[k]) < half])

    def converge_these(self, slow: Sequence[Names]) -> None:
        """Fit some sets until they converge."""
        self.fits.update(zip(slow, self.converged([self.fits[n] for n in slow]), strict=True))
        self._converged.update(slow)

    def _hopeful(self, size: int, without: Sequence[Names]) -> list[Names]:
        """Return the sets of a size that a further step may make the best, and those near the best."""
        near, ranked = self.near(size, without), [n for n in self.ranked(size) if n not in without]
        first = sorted(ranked, key=lambda n: self.fits[n].criterion - self._step_gain(n))[: self.converged_sets]
        return [n for n in ranked if n in first or n in near]

    def _step_gain(self, names: Names) -> float:
        return 0.0 if names in self._converged else self.step_gain(self.fits[names])

    def near(self, size: int, without: Sequence[Names] = ()) -> list[Names]:
        """Return the sets of a size, best first, with at least half of the best one's gain over the smaller sets."""
        ranked = [n for n in self.ranked(size) if n not in without]
        if not ranked:
            return []
        smaller = min((f.criterion for n, f in self.fits.items() if len(n) == size - 1), default=math.inf)
        half = 0.5 * (smaller + self.fits[ranked[0]].criterion)
        return [n for n in ranked if n == ranked[0] or self.fits[n].criterion < half]

    def ranked(self, size: int) -> list[Names]:
        """Return the sets of a size, lowest criterion first; those with physically impossible sizes come last."""
        absurd = {n for n in self._converged if not self.is_possible(self.fits[n])}
        return sorted((n for n in self.fits if len(n) == size), key=lambda n: (n in absurd, self.fits[n].criterion, n))


@dataclass(frozen=True)
class Candidate(Generic[S]):
    """A candidate by which a set may be extended.

    Attributes
    ----------
    gain
        Gain in twice the log-likelihood by the score test; 0 where none is made.
    start
        Start of a fit with the candidate.
    """

    gain: float
    start: S


class FittedSets(Sets[F], Generic[F, S]):
    """Fits of sets, of which each is begun at starts of its candidates."""

    @abstractmethod
    def candidates(self, base: F) -> Mapping[str, Candidate[S]]:
        """Return the candidates by which a set may be extended."""

    @abstractmethod
    def begin(self, base: F, starts: Mapping[Names, S]) -> Mapping[Names, F]:
        """Return first fits of sets that extend a base, each from its start."""

    def form_of(self, fitted: F) -> frozenset[Hashable]:
        """Return the forms of the candidates in a fit, where they have several."""
        return frozenset()

    def extend(self, base: Names, most: int | None = None) -> None:
        """Fit a set with each further candidate, or with the `most` of largest score.

        Of these a candidate of less than `FORM_SHARE` of the largest score is left out: an error in the form of another
        may score as much.

        Of several fits of a set the one of lowest criterion is kept.
        A fitted set is started again where candidates of the base have another form than in that set.
        """
        fitted = self.fits[base]
        forms = self.form_of(fitted)
        if (extended := (base, (forms, most))) in self._begun:
            return
        self._begun.add(extended)
        known = self.candidates(fitted)
        chosen = sorted(known, key=lambda n: (-known[n].gain, n))
        if most is not None:
            chosen = [n for n in chosen[:most] if not known[n].gain < FORM_SHARE * known[chosen[0]].gain]
        starts = {tuple(sorted((*base, n))): known[n].start for n in chosen}
        wanted = {k: s for k, s in starts.items() if self.is_within(k)}
        missing = {k: s for k, s in wanted.items() if (k, forms) not in self._begun and not self._has(k, forms)}
        self._begun.update((k, forms) for k in missing)
        for names, first in self.begin(fitted, missing).items():
            if names not in self.fits or first.criterion < self.fits[names].criterion:
                self.fits[names] = first
                self._converged.discard(names)
        if missing:
            self.converge(len(base) + 1)

    def _has(self, names: Names, forms: frozenset[Hashable]) -> bool:
        return names in self.fits and forms <= self.form_of(self.fits[names])


def more_degrees(larger: Fitted, smaller: Fitted) -> int:
    """Return the degrees of freedom that a larger set has more, at least 1."""
    return max(larger.degrees - smaller.degrees, 1)
