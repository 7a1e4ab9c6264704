"""Forward-backward search over sets of candidates, with a beam.

The criterion of a set is twice its negative log-likelihood, at the maximum over its free parameters, with a penalty for
each degree of freedom. It depends on the set alone. A larger set is accepted if its further candidate is significant
over the whole library. Source: Miller, Subset Selection in Regression, 2nd ed., 2002, chapter 3.
"""

import itertools
import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from fes_pin.infer.fits import F, Names, Sets, more_degrees
from fes_pin.infer.levels import UNUSUAL_LEVEL
from fes_pin.workers import OutOfTime, Progress, seconds_left, time_limit

M = TypeVar("M", bound=Sets[Any])
BEAM, FITTED = 3, 8
"""Sets of a size that are extended, and candidates that are fitted with each; a greedy search (1) names fewer pairs
exactly."""


@dataclass(frozen=True)
class Policy:
    """Options of a search.

    Attributes
    ----------
    beam
        Number of sets of a size that are judged, lowest criterion first, until one is accepted; and that are extended
        after.
    fitted
        Number of candidates of largest score that are fitted together with a set; None for all.
    fitted_first
        The same together with the nominal model.
    rivals
        The same in the place of each candidate of the best set.
    given
        A set that is judged without a search and without further rivals; None for a search.
    """

    beam: int = BEAM
    fitted: int | None = FITTED
    fitted_first: int | None = None
    rivals: int | None = FITTED
    given: Names | None = None


@dataclass(frozen=True)
class SearchResult(Generic[F]):
    """The result of a search.

    Attributes
    ----------
    nominal, best
        Fits of the nominal model and of the best set.
    p_values
        Family-wise p-value of each candidate of `best`, given the others.
    rivals
        For each candidate, fits with another candidate in its place, lowest criterion first.
    without
        For each candidate, the fit without it.
    """

    nominal: F
    best: F
    p_values: dict[str, float]
    rivals: dict[str, list[F]]
    without: dict[str, F]


class Search(Generic[F, M]):
    """A search among the sets of one problem.

    Attributes
    ----------
    models, sets
        The sets, with the type of their front end and as sets.
    was_stopped
        Whether a limit of time ended the search, so that the result is the best set so far.
    """

    def __init__(self, models: M, progress: Progress, policy: Policy | None = None) -> None:
        self.models: M = models
        self.sets: Sets[F] = models
        self.progress, self.policy = progress, policy or Policy()
        self.was_stopped, self._end = False, math.inf
        self._formed: set[Names] = set()
        self._rejected: set[Names] = set()

    def run(self) -> SearchResult[F]:
        """Search within the limit of time; the nominal model is fitted and its family simulated in any case."""
        self.progress(0.05, "nominal model")
        self._end = time.monotonic() + seconds_left()
        with time_limit(math.inf):
            self.sets.nominal()
        self._kept: Names = ()
        try:
            self._kept = self.backward(self.sets.first())
            given = self.policy.given
            return self.settle(self.backward(self._found_forward() if given is None else given))
        except OutOfTime:
            self.was_stopped = True
            with time_limit(math.inf):
                return self.result(self._kept)

    @property
    def seconds_left(self) -> float:
        """Seconds until the limit of time of the search."""
        return self._end - time.monotonic()

    def nominal(self) -> F:
        """Return the fit of the nominal model."""
        return self.sets.fits[()]

    def _found_forward(self) -> Names:
        """Return the best set of a forward search, repeated with another kind of noise where that is likelier."""
        self._forward()
        if self.sets.begin_again(self._kept):
            self._rejected.clear()
            self._formed.clear()
            self._forward()
        return self._kept

    def _forward(self) -> None:
        """Extend the best set so far while a larger one is accepted."""
        for size in itertools.count(len(self._kept) + 1):
            best = self._kept
            if not self.sets.has_room(best):
                break
            self.progress(min(0.1 + 0.2 * size, 0.7), f"sets of {size}")
            if best and not self._worth_extending(best):
                break
            for names in self.sets.near(size - 1)[: self.policy.beam]:
                self.sets.extend(names, self._most_with(names))
            larger = self._first_accepted(size, best)
            if larger is None:
                break
            self._kept = larger

    def _most_with(self, names: Names) -> int | None:
        """Return how many candidates are fitted together with a set; None for all."""
        return self.policy.fitted if names else self.policy.fitted_first

    def improves(self, larger: F, smaller: F, gain: float, explained: float) -> bool:
        """Return whether a larger set improves on a smaller one by a gain in twice the log-likelihood.

        Parameters
        ----------
        gain, explained
            Gain of the larger over the smaller set, and over the nominal model.
        """
        significant = self.sets.p_value(larger, smaller, gain) < self.sets.level(larger)
        return significant and not self.sets.is_error_of_form(larger, gain, explained)

    def is_accepted(self, larger: F, smaller: F) -> bool:
        """Return whether a larger fit improves on a smaller one, or is possible where the smaller is not.

        The noise of a fit that is no model takes up every error: its likelihood may be large.
        """
        possible = self.sets.is_possible(larger)
        if possible != self.sets.is_possible(smaller):
            return possible
        return self.improves(larger, smaller, smaller.sse - larger.sse, self.nominal().sse - larger.sse)

    def possible(self) -> dict[Names, F]:
        """Return the nominal model and all fitted sets but those that are not possible or were rejected."""
        models = self.sets
        return {n: f for n, f in models.fits.items() if not n or (n not in self._rejected and models.is_possible(f))}

    def _worth_extending(self, names: Names) -> bool:
        """Return whether the score of a further candidate is significant, or the set has a lack of fit.

        Scores are slopes at the noise of the set. That noise includes the effect of a missing candidate, so that scores
        understate its gain.
        """
        fitted = self.sets.fits[names]
        return self.sets.extension_p_value(fitted) < UNUSUAL_LEVEL or not self.sets.leaves_noise(fitted)

    def _first_accepted(self, size: int, best: Names) -> Names | None:
        """Return the accepted set of a size of lowest criterion; sets that are not accepted are left out in turn."""
        tried: list[Names] = []
        while len(tried) < self.policy.beam and (ranked := self._in_better_forms(size, tried, best)):
            if self._is_accepted(ranked[0], best):
                return ranked[0]
            tried.append(ranked[0])
            self.sets.converge(size, tried)
        return None

    def _in_better_forms(self, size: int, without: Sequence[Names], best: Names) -> list[Names]:
        """Return the best sets of a size except some, lowest criterion first, each in its significant form."""
        most = self.policy.beam
        while rough := [n for n in self.sets.near(size, without)[:most] if self._is_rough(n, best)]:
            self._reform(rough[0])
        return self.sets.near(size, without)[:most]

    def _is_rough(self, names: Names, best: Names) -> bool:
        """Return whether a set has tried no other form and has half of the required gain, to which a form may add."""
        if names in self._formed:
            return False
        larger, smaller = self.sets.fits[names], self.sets.fits[best]
        doubled = 2.0 * (smaller.sse - larger.sse)
        return self.sets.noise_p_value(doubled, more_degrees(larger, smaller)) < self.sets.level(larger)

    def _is_accepted(self, names: Names, best: Names) -> bool:
        """Return whether a set is physically possible and improves on the best smaller one.

        A further candidate must also lower the errors of prediction, if the smaller set has no lack of fit. Where it
        has one, yet another candidate may be needed to lower the errors.
        """
        models = self.sets
        larger, smaller = models.fits[names], models.fits[best]
        accepted = self.is_accepted(larger, smaller)
        if accepted and best and models.leaves_noise(smaller):
            accepted = models.predicts_better(larger, smaller)
        return self._kept_in_mind(names, accepted) and models.is_possible(larger)

    def _kept_in_mind(self, names: Names, accepted: bool) -> bool:
        """Record whether a set is accepted, and return that."""
        (self._rejected.discard if accepted else self._rejected.add)(names)
        return accepted

    def _reform(self, names: Names) -> None:
        """Give a set, once, the form that is significant."""
        fits = self.sets.fits
        while names not in self._formed and (better := self.sets.better_form(fits[names])) is not None:
            fits[names] = better
        self._formed.add(names)

    def backward(self, names: Names) -> Names:
        """Return a fitted set without the candidates that are not significant given the others."""
        while names:
            less = {n: self.sets.without(names, n) for n in names}
            p_values = {n: self.sets.p_value(self.sets.fits[names], less[n]) for n in names}
            weakest = max(names, key=lambda n: (p_values[n], -less[n].sse))
            if self.is_accepted(self.sets.fits[names], less[weakest]):
                break
            names = tuple(n for n in names if n != weakest)
        return names

    def settle(self, names: Names, rejected: Iterable[str] = ()) -> SearchResult[F]:
        """Return the result for a set, with the rivals of each of its candidates.

        A rival set that is better, and whose candidates are all accepted, becomes the answer: sets were extended by one
        candidate at a time, and the best candidate of a smaller set need not be the best of a larger one.

        Parameters
        ----------
        names
            A fitted set.
        rejected
            Names that no answer may contain.
        """
        self._reform(names)
        while self.policy.given is None and (better := self._best_of_rivals(names, rejected)) != names:
            names = better
        return self.result(names)

    def _best_of_rivals(self, names: Names, rejected: Iterable[str]) -> Names:
        """Fit the rivals of a set, and return the best of all that can be the answer."""
        self.progress(0.75, "rivals")
        for name in filter(self.sets.is_claimed, names):
            rest = tuple(n for n in names if n != name)
            self.sets.without(names, name)
            self.sets.extend(rest, self.policy.rivals if rest else self.policy.fitted_first)
            self.sets.converge_rivals(names, name)
        return next(n for n in self.sets.ranked(len(names)) if n == names or self._may_be(n, rejected))

    def _may_be(self, names: Names, rejected: Iterable[str]) -> bool:
        """Return whether a set can be the answer: none of its candidates is rejected, and each is accepted."""
        if set(names) & set(rejected):
            return False
        self._reform(names)
        return self._kept_in_mind(names, self.backward(names) == names)

    def result(self, names: Names) -> SearchResult[F]:
        """Return the result for a set from the fitted sets, without a search for further rivals."""
        models = self.sets
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
