"""The verdict on what a search found: a table of claims in a stated order, each of which may change that.

A claim looks at a state and returns another one, or None where it has nothing to object. After each change the table is
gone through from its beginning; the state that no claim objects to is the verdict.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

from fes_pin.infer.held_out import is_supported
from fes_pin.infer.result import Evidence, Gain
from fes_pin.infer.search import Fitted, M, Search, SearchResult

F = TypeVar("F", bound=Fitted)

CAUSES_FOUND, UNEXPLAINED, ADEQUATE, STOPPED = "causes_found", "unexplained", "adequate", "stopped"


class LackOfFit(Protocol):
    """What the tests of lack of fit say of a fit."""

    @property
    def unexplained(self) -> bool:
        """Whether the fit leaves more than noise."""


@dataclass(frozen=True)
class Rejected:
    """A candidate that was significant in the fit, and is not claimed.

    Attributes
    ----------
    p_value
        Family-wise, of what it added.
    share
        Of what all candidates together added to the log-likelihood.
    gain
        On the data that it was judged by.
    """

    p_value: float
    share: float
    gain: Gain


@dataclass(frozen=True)
class Weighed:
    """What the data say of each candidate of a set.

    Attributes
    ----------
    gains
        On data held out; on the data that were fitted where none could be.
    evidence
        What each candidate adds to the likelihood of data held out; empty where none could be.
    lack_of_fit
        Of the set.
    """

    gains: Mapping[str, Gain]
    evidence: Mapping[str, Evidence]
    lack_of_fit: LackOfFit


W = TypeVar("W", bound=Weighed)


@dataclass(frozen=True)
class State(Generic[F, M, W]):
    """A verdict on its way.

    Attributes
    ----------
    search
        The search, by one estimator, that the set is of.
    found
        A set of candidates, its rivals, and the set less each candidate.
    weighed
        What the data say of it.
    rejected
        Candidates that no answer may hold.
    settled
        The set for which rivals were searched last.
    formed
        Sets that were tried in another form.
    steps
        The claims that changed the state, in their order.
    replaced
        The state of another estimator of the same data, in whose place this one is; None if no estimator was replaced.
    """

    search: Search[F, M]
    found: SearchResult[F]
    weighed: W
    rejected: Mapping[str, Rejected]
    settled: frozenset[str]
    formed: frozenset[frozenset[str]] = frozenset()
    steps: tuple[str, ...] = ()
    replaced: State[F, M, W] | None = None

    @property
    def names(self) -> frozenset[str]:
        """The candidates of the set."""
        return frozenset(self.found.without)

    @property
    def weak(self) -> list[str]:
        """The candidates of the set, smallest gain first."""
        return sorted(sorted(self.names), key=lambda n: self.weighed.gains[n].low)


Claim = Callable[[State[F, M, W]], State[F, M, W] | None]


class Verdict(ABC, Generic[F, M, W]):
    """The claims of one front end, in `claims` by their order, and what they are made of.

    Parameters
    ----------
    search
        That has run.
    """

    def __init__(self, search: Search[F, M]) -> None:
        self.search = search
        self.claims: Sequence[Claim[F, M, W]] = (
            self.drop_unsupported,
            self.settle,
            self.drop_rarely_chosen,
            self.try_another_form,
            self.switch_estimator,
        )

    @abstractmethod
    def weigh(self, found: SearchResult[F]) -> W:
        """What data held out, and the tests of lack of fit, say of a set."""

    def lack_of_fit(self, state: State[F, M, W]) -> LackOfFit:
        """What is left by a set, and by the candidates that were rejected beside it."""
        return state.weighed.lack_of_fit

    def unsupported(self, state: State[F, M, W]) -> list[str]:
        """Candidates that data held out do not speak for."""
        weighed, names = state.weighed, state.names
        if not weighed.evidence:
            return [n for n in names if len(names) > 1 and not weighed.gains[n].is_material]
        open_ = weighed.lack_of_fit.unexplained
        known = {n: None if open_ else weighed.evidence[n] for n in names}
        return [n for n, e in known.items() if not is_supported(e, weighed.gains[n], alone=len(names) == 1)]

    def is_rarely_chosen(self, state: State[F, M, W], name: str) -> bool:
        """Whether most folds of the data choose a set without a candidate."""
        return False

    def by_another_estimator(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """The verdict by another estimator of the same data; None where there is none, or where it has no say."""
        return None

    def prediction_error(self, state: State[F, M, W]) -> float:
        """Error of the fitted data, each predicted by a fit to the others: by it an estimator is chosen."""
        raise NotImplementedError

    def of(
        self, found: SearchResult[F], search: Search[F, M] | None = None, replaced: State[F, M, W] | None = None
    ) -> State[F, M, W]:
        """The state that no claim objects to.

        Parameters
        ----------
        found
            A set that a search found.
        search
            That search; by default the verdict's own.
        replaced
            The state by another estimator, in whose place this one may be.
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
        """Refuse the weakest of the candidates that data held out do not speak for."""
        return self._without_weakest(state, self.unsupported(state))

    def settle(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Search the rivals of a set that candidates were taken from."""
        if state.names == state.settled:
            return None
        found = state.search.settle(tuple(sorted(state.names)), state.rejected)
        return replace(state, found=found, weighed=self.weigh(found), settled=state.names)

    def drop_rarely_chosen(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Refuse the weakest of the candidates that most folds of the data do not choose."""
        return self._without_weakest(state, [n for n in state.names if self.is_rarely_chosen(state, n)])

    def try_another_form(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Where a lack of fit remains, give the set a form that was reached another way; rejected causes may return."""
        names = tuple(sorted(state.names))
        if not self.lack_of_fit(state).unexplained or state.names in state.formed:
            return None
        if not state.search.form_otherwise(names):
            return None
        found = state.search.settle(names)
        settled, formed = frozenset(found.without), state.formed | {state.names}
        return replace(state, found=found, weighed=self.weigh(found), rejected={}, settled=settled, formed=formed)

    def switch_estimator(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Take the verdict of another estimator of the same data where that predicts them better; this is tried once.

        Data that the study itself holds out have no say in it: gains on them would be optimistic.
        """
        other = None if state.replaced else self.by_another_estimator(state)
        if other is None or not self.prediction_error(other) < self.prediction_error(state):
            return None
        return replace(other, steps=(*state.steps, *other.steps))

    def _without_weakest(self, state: State[F, M, W], some: Sequence[str]) -> State[F, M, W] | None:
        """The set less the weakest of some of its candidates; None if these are none."""
        weakest = next((n for n in state.weak if n in some), None)
        if weakest is None:
            return None
        rejected = {**state.rejected, weakest: rejection_from(state.found, weakest, state.weighed.gains[weakest])}
        found = state.search.result(tuple(sorted(state.names - {weakest})))
        return replace(state, found=found, weighed=self.weigh(found), rejected=rejected)


def rejection_from(found: SearchResult[F], name: str, gain: Gain) -> Rejected:
    """What is kept of a candidate that is taken from a set."""
    return Rejected(found.p_values[name], share_in(found, name), gain)


def share_in(found: SearchResult[F], name: str) -> float:
    """Share of a candidate in what all that were found add to the log-likelihood."""
    whole = found.nominal.sse - found.best.sse
    return (found.without[name].sse - found.best.sse) / max(whole, 1e-9)


def word_of(has_candidates: bool, lack_of_fit: LackOfFit, stopped: bool = False) -> str:
    """The verdict in a word."""
    if stopped:
        return STOPPED
    return CAUSES_FOUND if has_candidates else UNEXPLAINED if lack_of_fit.unexplained else ADEQUATE
