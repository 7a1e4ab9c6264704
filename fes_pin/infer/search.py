"""Forward-backward search over sets of candidates, with a beam.

A set's price is twice its negative log-likelihood, maximised over all that is free in it, with a penalty for each
degree of freedom; it depends on the set alone. A larger set is taken where it is significant over the whole library of
candidates together with the others in it. Source: Miller, Subset Selection in Regression, 2nd ed., 2002, chapter 3.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from fes_pin.infer.levels import UNUSUAL_LEVEL
from fes_pin.workers import OutOfTime, Progress, seconds_left, time_limit

Names = tuple[str, ...]
"""Names of the candidates of a set, in alphabetical order."""


class Fitted(Protocol):
    """A fit of a set of candidates."""

    @property
    def sse(self) -> float:
        """Twice the negative log-likelihood, but for a constant."""

    @property
    def criterion(self) -> float:
        """The same with a penalty for each degree of freedom."""

    @property
    def degrees(self) -> int:
        """Degrees of freedom."""


F = TypeVar("F", bound=Fitted)
M = TypeVar("M")
M_co = TypeVar("M_co", covariant=True)


class Models(Protocol[F, M_co]):
    """The fitted sets of one problem, and how its front end judges them.

    Attributes
    ----------
    fits
        Fits by the names of their candidates; `()` is the nominal model.
    """

    fits: dict[Names, F]

    @property
    def own(self) -> M_co:
        """These models, by the type that their front end knows."""

    @property
    def most_candidates(self) -> int | None:
        """Candidates in a set, at most; None for no bound."""

    def nominal(self) -> F:
        """Fit the nominal model, and what sets are judged by; raises where no number comes of it."""

    def extend(self, base: Names, most: int | None = None) -> None:
        """Fit a set with each further candidate, or with the `most` of largest score."""

    def extend_by_pairs(self, most: int) -> None:
        """Fit the pairs of candidates of largest score together, for those that show nothing alone."""

    def converge(self, size: int, without: Sequence[Names] = ()) -> None:
        """Let the best sets of a size converge, but for some."""

    def converge_rivals(self, base: Names, name: str) -> None:
        """Let the sets converge that have another candidate of about the same score in the place of one."""

    def ranked(self, size: int) -> list[Names]:
        """Sets of a size, lowest price first; those that are physically impossible last."""

    def near(self, size: int, without: Sequence[Names] = ()) -> list[Names]:
        """Sets of a size that come near the best, best first, but for some."""

    def without(self, names: Names, name: str) -> F:
        """The fit of a set less one candidate."""

    def is_possible(self, fitted: F) -> bool:
        """Whether every size of a fit is physically possible."""

    def p_value(self, larger: F, smaller: F, gain: float | None = None) -> float:
        """Family-wise p-value of what a larger set gains, or of a gain in its place, as far as pieces agree on it."""

    def noise_p_value(self, gain: float, degrees: int) -> float:
        """Family-wise p-value of a gain in twice the log-likelihood against the noise."""

    def extension_p_value(self, fitted: F) -> float:
        """Family-wise p-value of the score of the best further candidate; 0 where every candidate is fitted."""

    def level(self, fitted: F) -> float:
        """Family-wise level of a claim."""

    def is_error_of_form(self, larger: F, gain: float, explained: float) -> bool:
        """Whether a gain is no more than an error in the form of the other candidates leaves of what all explain."""

    def predicts_better(self, larger: F, smaller: F) -> bool:
        """Whether what a set adds lessens the errors of prediction."""

    def leaves_noise(self, fitted: F) -> bool:
        """Whether no lack of fit is found."""

    def better_form(self, fitted: F) -> F | None:
        """The same set in another form that the data demand; None where they demand none."""

    def other_form(self, fitted: F) -> F | None:
        """The same set in a form that was reached another way, where that is better."""

    def begin_again(self, names: Names) -> bool:
        """Fit a set and the nominal model under the noise that the set leaves; False where every fit has its own."""


@dataclass(frozen=True)
class Policy:
    """How widely a search looks.

    Attributes
    ----------
    beam
        Sets of a size that are extended. Greedy search (1) names fewer pairs exactly.
    fitted
        Candidates that are fitted together with a set, those of largest score; None for all. With the nominal model
        all are.
    pairs
        Pairs that the score test proposes, for candidates that show nothing alone.
    judged
        Sets of a size that are judged, lowest price first, until one is accepted.
    given
        A set that is judged in the place of a search, without further rivals; None for a search.
    """

    beam: int = 3
    fitted: int | None = 8
    pairs: int = 4
    judged: int = 3
    given: Names | None = None


@dataclass(frozen=True)
class SearchResult(Generic[F]):
    """What a search found.

    Attributes
    ----------
    nominal, best
        Fits.
    p_values
        Family-wise, of each candidate of `best` together with the others.
    rivals
        For each candidate, fits in which another has its place, lowest price first.
    without
        For each candidate, the fit without it.
    """

    nominal: F
    best: F
    p_values: dict[str, float]
    rivals: dict[str, list[F]]
    without: dict[str, F]


class Search(Generic[F, M]):
    """One search on the sets of one problem.

    Attributes
    ----------
    models
        The sets.
    was_stopped
        True where a limit of time ended it: the result is the best set so far.
    """

    def __init__(self, models: Models[F, M], progress: Progress, policy: Policy | None = None) -> None:
        self.models, self._sets = models.own, models
        self.progress, self.policy = progress, policy or Policy()
        self.was_stopped, self._end = False, math.inf
        self._formed: set[Names] = set()
        self._rejected: set[Names] = set()

    def run(self) -> SearchResult[F]:
        """Search as long as the limit of time lets it; the nominal model is fitted and its family simulated anyway."""
        self.progress(0.05, "nominal model")
        self._end = time.monotonic() + seconds_left()
        with time_limit(math.inf):
            self._sets.nominal()
        self._kept: Names = ()
        try:
            return self._search()
        except OutOfTime:
            self.was_stopped = True
            with time_limit(math.inf):
                return self.result(self._kept)

    @property
    def seconds_left(self) -> float:
        """Until the limit of time that the search began with."""
        return self._end - time.monotonic()

    def nominal(self) -> F:
        """The fit of the nominal model."""
        return self._sets.fits[()]

    def _search(self) -> SearchResult[F]:
        given = self.policy.given
        return self.settle(self._backward(self._found_forward() if given is None else given))

    def _found_forward(self) -> Names:
        """The best set of a forward search; of another under the noise that it leaves, where that changes."""
        self._forward()
        if self._sets.begin_again(self._kept):
            self._rejected.clear()
            self._formed.clear()
            self._forward()
        return self._kept

    def _forward(self) -> None:
        """Extend the best set so far as long as a larger one is accepted."""
        for size in self._sizes():
            best = self._kept
            self.progress(min(0.1 + 0.2 * size, 0.7), f"sets of {size}")
            if best and not self._worth_extending(best):
                break
            self._extend(size)
            larger = self._first_accepted(size, best)
            if larger is None:
                break
            self._kept = larger

    def _sizes(self) -> Iterable[int]:
        """Sizes of sets that are larger than the best so far."""
        first, most = len(self._kept) + 1, self._sets.most_candidates
        return itertools.count(first) if most is None else range(first, most + 1)

    def improves(self, larger: F, smaller: F, gain: float, explained: float) -> bool:
        """Whether a larger set is worth its degrees of freedom where it gains so much in twice the log-likelihood."""
        significant = self._sets.p_value(larger, smaller, gain) < self._sets.level(larger)
        return significant and not self._sets.is_error_of_form(larger, gain, explained)

    def is_accepted(self, larger: F, smaller: F) -> bool:
        """The same of two fits as they are."""
        return self.improves(larger, smaller, smaller.sse - larger.sse, self.nominal().sse - larger.sse)

    def possible(self) -> dict[Names, F]:
        """All sets that are fitted, but for those that cannot be, or that were rejected."""
        models = self._sets
        return {n: f for n, f in models.fits.items() if n not in self._rejected and models.is_possible(f)}

    def _worth_extending(self, names: Names) -> bool:
        """Whether a further candidate has a score that chance does not bring, or the set has a lack of fit.

        Scores are slopes at the noise of the set, which takes up a candidate that is missed: they understate it.
        """
        fitted = self._sets.fits[names]
        return self._sets.extension_p_value(fitted) < UNUSUAL_LEVEL or not self._sets.leaves_noise(fitted)

    def _extend(self, size: int) -> None:
        """Fit sets of a size: the best smaller ones with further candidates, and pairs of largest score together."""
        for names in self._sets.near(size - 1)[: self.policy.beam]:
            self._sets.extend(names, None if size == 1 else self.policy.fitted)
        if size == 2:
            self._sets.extend_by_pairs(self.policy.pairs)

    def _first_accepted(self, size: int, best: Names) -> Names | None:
        """The set of a size of lowest price that is accepted; those near it are judged without those that are not."""
        tried: list[Names] = []
        while len(tried) < self.policy.judged and (ranked := self._in_better_forms(size, tried, best)):
            if self._is_accepted(ranked[0], best):
                return ranked[0]
            tried.append(ranked[0])
            self._sets.converge(size, tried)
        return None

    def _in_better_forms(self, size: int, without: Sequence[Names], best: Names) -> list[Names]:
        """The best sets of a size but for some, lowest price first, once each has the form that the data demand."""
        most = self.policy.judged
        while rough := [n for n in self._sets.near(size, without)[:most] if self._is_rough(n, best)]:
            self._reform(rough[0])
        return self._sets.near(size, without)[:most]

    def _is_rough(self, names: Names, best: Names) -> bool:
        """Whether a set has not had another form yet, and half of what it must gain: a form may give the other half."""
        if names in self._formed:
            return False
        larger, smaller = self._sets.fits[names], self._sets.fits[best]
        degrees = max(larger.degrees - smaller.degrees, 1)
        return self._sets.noise_p_value(2.0 * (smaller.sse - larger.sse), degrees) < self._sets.level(larger)

    def _is_accepted(self, names: Names, best: Names) -> bool:
        """Whether a set can be, and is worth more than the best smaller one."""
        models = self._sets
        larger, smaller = models.fits[names], models.fits[best]
        accepted = self.is_accepted(larger, smaller) and self._predicts_better(larger, smaller, bool(best))
        return self._kept_in_mind(names, accepted) and models.is_possible(larger)

    def _predicts_better(self, larger: F, smaller: F, has_candidates: bool) -> bool:
        """Whether a further candidate lessens the errors of prediction, where the smaller set leaves only noise.

        Where the smaller set has a lack of fit, a still further candidate may bring that about.
        """
        if not has_candidates or not self._sets.leaves_noise(smaller):
            return True
        return self._sets.predicts_better(larger, smaller)

    def _kept_in_mind(self, names: Names, accepted: bool) -> bool:
        """Whether a set is accepted, after that was written down."""
        (self._rejected.discard if accepted else self._rejected.add)(names)
        return accepted

    def _reform(self, names: Names) -> None:
        """Give a set, once, the form that the data demand."""
        while names not in self._formed and self._replaced(names, self._sets.better_form(self._sets.fits[names])):
            pass
        self._formed.add(names)

    def _replaced(self, names: Names, better: F | None) -> bool:
        """Take a better fit of a set; False if there is none."""
        if better is not None:
            self._sets.fits[names] = better
        return better is not None

    def form_otherwise(self, names: Names) -> bool:
        """Give a set another form than it was led to, if one is better; False if none is, or time is up."""
        try:
            with time_limit(self.seconds_left):
                return self._replaced(names, self._sets.other_form(self._sets.fits[names]))
        except OutOfTime:
            return False

    def _backward(self, names: Names) -> Names:
        """Drop candidates that the others have made superfluous."""
        while names:
            less = {n: self._sets.without(names, n) for n in names}
            p_values = {n: self._sets.p_value(self._sets.fits[names], less[n]) for n in names}
            weakest = max(names, key=lambda n: (p_values[n], -less[n].sse))
            if self.is_accepted(self._sets.fits[names], less[weakest]):
                break
            names = tuple(n for n in names if n != weakest)
        return names

    def settle(self, names: Names, rejected: Iterable[str] = ()) -> SearchResult[F]:
        """The result for a set, with the rivals of each of its candidates.

        Where a rival is the better set, and each of its candidates is accepted, it is the answer: sets were extended
        by one candidate at a time, and what was best in a smaller set need not be best in the whole one.

        Parameters
        ----------
        names
            A set that is fitted.
        refused
            Names that no answer may hold.
        """
        self._reform(names)
        while self.policy.given is None and (better := self._best_of_rivals(names, rejected)) != names:
            names = better
        return self.result(names)

    def _best_of_rivals(self, names: Names, rejected: Iterable[str]) -> Names:
        """The best of a set and its rivals that can be the answer, once the rivals are fitted."""
        self.progress(0.75, "rivals")
        for name in names:
            rest = tuple(n for n in names if n != name)
            self._sets.without(names, name)
            self._sets.extend(rest, None if len(names) == 1 else self.policy.fitted)
            self._sets.converge_rivals(rest, name)
        return next(n for n in self._sets.ranked(len(names)) if n == names or self._may_be(n, rejected))

    def _may_be(self, names: Names, rejected: Iterable[str]) -> bool:
        """Whether a set can be the answer: it holds nothing refused, and each of its candidates is accepted."""
        if set(names) & set(rejected):
            return False
        self._reform(names)
        return self._kept_in_mind(names, self._backward(names) == names)

    def result(self, names: Names) -> SearchResult[F]:
        """The result for a set from the sets that are fitted, without a search for further rivals."""
        models = self._sets
        rivals: dict[str, list[F]] = {}
        without: dict[str, F] = {}
        for name in names:
            rest = tuple(n for n in names if n != name)
            without[name] = models.without(names, name)
            others = [k for k in models.fits if len(k) == len(names) and set(rest) <= set(k) and name not in k]
            finite = (f for k in others if math.isfinite((f := models.fits[k]).sse) and models.is_possible(f))
            rivals[name] = sorted(finite, key=lambda f: f.criterion)
        best = models.fits[names]
        p_values = {n: models.p_value(best, without[n]) for n in names}
        return SearchResult(models.fits[()], best, p_values, rivals, without)
