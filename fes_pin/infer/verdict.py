"""The verdict on what a search found: a table of claims in a stated order, each of which may change the set.

A claim takes a state and returns another one, or None if it has no objection. After each change the table is applied
from its beginning. The state to which no claim objects is the verdict.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from fes_pin.infer.fits import F
from fes_pin.infer.held_out import is_supported
from fes_pin.infer.levels import NOTHING_PERCENT
from fes_pin.infer.result import FITTED, Evidence, Gain, Remainder
from fes_pin.infer.search import M, Search, SearchResult
from fes_pin.infer.text import WHOLE


@dataclass(frozen=True)
class Rejected:
    """A candidate that was significant in the fit, and is not named.

    Attributes
    ----------
    p_value
        Family-wise p-value of its gain.
    share
        Its share of the gain of all candidates in log-likelihood.
    gain
        Its gain on the data by which it was judged.
    """

    p_value: float
    share: float
    gain: Gain


@dataclass(frozen=True)
class Weighed:
    """Evidence of the data on each candidate of a set.

    Attributes
    ----------
    gains
        Gains on held-out data; on the fitted data where none could be held out.
    evidence
        Evidence in the likelihood of the same data; empty where a front end has none.
    lack_of_fit
        Lack of fit of the set.
    """

    gains: Mapping[str, Gain]
    evidence: Mapping[str, Evidence]
    lack_of_fit: Remainder


W = TypeVar("W", bound=Weighed)


@dataclass(frozen=True)
class State(Generic[F, M, W]):
    """A state of the verdict between claims.

    Attributes
    ----------
    search
        The search, by one estimator, to which the set belongs.
    found
        A set of candidates, its rivals, and the set without each candidate.
    weighed
        Evidence of the data on the set.
    rejected
        Candidates that no answer may contain.
    settled
        The set for which rivals were searched last.
    steps
        The claims that changed the state, in their order.
    replaced
        The state of another estimator of the same data that this one replaces; None if no estimator was replaced.
    """

    search: Search[F, M]
    found: SearchResult[F]
    weighed: W
    rejected: Mapping[str, Rejected]
    settled: frozenset[str]
    steps: tuple[str, ...] = ()
    replaced: State[F, M, W] | None = None

    @property
    def names(self) -> frozenset[str]:
        """The candidates of the set."""
        return frozenset(self.found.without)


Claim = Callable[[State[F, M, W]], State[F, M, W] | None]


class Verdict(ABC, Generic[F, M, W]):
    """The claims of one front end, in the order of `claims`, and the decisions that they use.

    Parameters
    ----------
    search
        A search that has run.
    """

    def __init__(self, search: Search[F, M]) -> None:
        self.search = search

    @property
    def claims(self) -> Sequence[Claim[F, M, W]]:
        """The claims in their order."""
        return self.drop_unsupported, self.settle, self.drop_rarely_chosen, self.drop_impossible, self.switch_estimator

    @abstractmethod
    def weigh(self, found: SearchResult[F]) -> W:
        """Return the evidence of held-out data and of the tests of lack of fit on a set."""

    def lack_of_fit(self, state: State[F, M, W]) -> Remainder:
        """Return the lack of fit of a set, in view of the rejected candidates and of the estimator replaced."""
        return state.weighed.lack_of_fit

    def evidence(self, state: State[F, M, W]) -> dict[str, Evidence | None]:
        """Return the evidence for each candidate; None where there is a lack of fit, but of fitted data alone.

        A likelihood says little of a wrong model. Its errors of prediction, which no fit minimises, say less of the
        data that it was fitted to.
        """
        wrong = self.lack_of_fit(state).unexplained
        return {n: None if wrong and e.on != FITTED else e for n, e in state.weighed.evidence.items()}

    def unsupported(self, state: State[F, M, W]) -> list[str]:
        """Return the candidates that held-out data do not support; where none could be held out, the fitted data."""
        known, gains = self.evidence(state), state.weighed.gains
        return [n for n, e in known.items() if not is_supported(e, gains[n], alone=len(known) == 1)]

    def is_rarely_chosen(self, state: State[F, M, W], name: str) -> bool:
        """Return whether most folds of the data choose a set without a candidate."""
        return False

    def impossible(self, state: State[F, M, W]) -> list[str]:
        """Return the candidates that no answer may contain: at a bound, or of no more than twice their deviation."""
        return []

    def by_another_estimator(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Return the verdict of another estimator of the same data; None where there is none."""
        return None

    def prediction_error(self, state: State[F, M, W]) -> float:
        """Return the cross-validated error of the fitted data, by which estimators are compared; 0 of one."""
        return 0.0

    def of(
        self, found: SearchResult[F], search: Search[F, M] | None = None, replaced: State[F, M, W] | None = None
    ) -> State[F, M, W]:
        """Return the state to which no claim objects.

        Parameters
        ----------
        found
            The result of a search.
        search
            That search; by default the verdict's own.
        replaced
            The state by another estimator that this one may replace.
        """
        weighed, settled = self.weigh(found), frozenset(found.without)
        state = State(search or self.search, found, weighed, {}, settled, replaced=replaced)
        while True:
            for claim in self.claims:
                if (changed := claim(state)) is not None:
                    state = replace(changed, steps=(*changed.steps, claim.__name__))
                    break
            else:
                return state

    def drop_unsupported(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Reject the weakest of the candidates that held-out data do not support."""
        return self._without_weakest(state, self.unsupported(state))

    def settle(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Search the rivals of a set from which candidates were rejected."""
        if state.names == state.settled:
            return None
        found = state.search.settle(tuple(sorted(state.names)), state.rejected)
        return replace(state, found=found, weighed=self.weigh(found), settled=state.names)

    def drop_rarely_chosen(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Reject the weakest of the candidates that most folds of the data do not choose."""
        return self._without_weakest(state, [n for n in state.names if self.is_rarely_chosen(state, n)])

    def drop_impossible(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Reject the weakest of the candidates that no answer may contain."""
        return self._without_weakest(state, self.impossible(state))

    def switch_estimator(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Take the verdict of another estimator of the same data if it predicts materially better; tried once.

        Data that the study itself holds out are not used: gains on them would be optimistic.
        """
        other, material = None if state.replaced else self.by_another_estimator(state), 1.0 - NOTHING_PERCENT / WHOLE
        if other is None or not self.prediction_error(other) < material * self.prediction_error(state):
            return None
        return replace(other, steps=(*state.steps, *other.steps))

    def _without_weakest(self, state: State[F, M, W], some: Sequence[str]) -> State[F, M, W] | None:
        """Return the state without the weakest of some candidates; None if there are none."""
        gains = state.weighed.gains
        weakest = min(some, key=lambda n: (gains[n].low, n), default=None)
        if weakest is None:
            return None
        rejected = Rejected(state.found.p_values[weakest], share_in(state.found, weakest), gains[weakest])
        found = state.search.result(tuple(sorted(state.names - {weakest})))
        return replace(state, found=found, weighed=self.weigh(found), rejected={**state.rejected, weakest: rejected})


def share_in(found: SearchResult[F], name: str) -> float:
    """Return the share of a candidate in the gain of all candidates in log-likelihood."""
    whole = found.nominal.sse - found.best.sse
    return (found.without[name].sse - found.best.sse) / max(whole, 1e-9)


def word_of(has_candidates: bool, lack_of_fit: Remainder) -> str:
    """Return the verdict in a word."""
    return "causes_found" if has_candidates else "unexplained" if lack_of_fit.unexplained else "adequate"
