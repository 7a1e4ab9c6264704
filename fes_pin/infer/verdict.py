"""The verdict on what a search found: a table of claims in a stated order, each of which may change the set.

A claim takes a state and returns another one, or None if it has no objection. After each change the table is applied
from its beginning. The state to which no claim objects is the verdict. Every front end has the same claims: a claim
that asks for what a front end does not weigh has no objection there.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Generic, TypeVar

from fes_pin.infer.fits import F
from fes_pin.infer.held_out import Errors, is_supported
from fes_pin.infer.levels import CONFIDENCE_95, FORM_SHARE
from fes_pin.infer.result import FITTED, Evidence, Gain, Remainder, p_shown
from fes_pin.infer.search import M, Search, SearchResult
from fes_pin.infer.text import WHOLE, probability

ADEQUATE = "adequate"
"""Verdict on a model without a lack of fit, of which no candidate is named."""
CLAIMS = {
    "drop_unmoved": "the motion is as likely without the recorded input, so something else moves the system",
    "drop_errors_of_form": "process noise is large, and it gains no more than an error of form may",
    "drop_unsupported": "held-out data do not confirm it",
    "drop_not_carried": "it gains nothing on other parts of the data, where it must act too",
    "drop_unrepeated": "equal repeats differ, and by chance or a constant that explains as much",
    "drop_that_predict_no_better": "the sets that folds choose predict no better than the nominal model",
    "drop_insignificant": "its gain is not significant",
    "settle": "the rivals of what remains were searched",
    "drop_rarely_chosen": "most folds of the data choose a set without it",
    "drop_of_no_model": "a constant predicts as well as the model, or a nominal parameter is at a bound",
    "drop_impossible": "the size of a candidate is not physically possible",
    "drop_uncertain": "its size is not twice its deviation",
}
"""The claims in their order, each with the reason, in words, for which it rejects a candidate or changes the answer."""


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
    claim
        The claim that rejected it.
    """

    p_value: float
    share: float
    gain: Gain
    claim: str = ""

    @property
    def reason(self) -> str:
        """Why, in words."""
        return CLAIMS[self.claim]

    def __str__(self) -> str:
        return f"{self.reason} ({probability(self.p_value)}, gain {self.gain})"

    def record(self) -> dict[str, Any]:
        """As JSON files have it."""
        gain = {} if self.gain.is_none else {"gain": self.gain.record()}
        return {"claim": self.claim, "reason": self.reason, "p_value": p_shown(self.p_value), **gain}


@dataclass(frozen=True)
class Step:
    """A step to an answer.

    Attributes
    ----------
    claim
        The claim that changed the answer, one of `CLAIMS`; or another step.
    name
        The candidate that it rejected; empty if it rejected none.
    words
        What it found, in words.
    """

    claim: str
    name: str = ""
    words: str = ""

    def __str__(self) -> str:
        return f"{self.name}: {CLAIMS[self.claim]}" if self.name else self.words or CLAIMS[self.claim]

    def record(self) -> dict[str, str]:
        """As JSON files have it."""
        return {n: value for n, value in vars(self).items() if value}


@dataclass(frozen=True)
class Weighed:
    """Evidence of the data on each claim of a set.

    Attributes
    ----------
    gains
        Gain in errors of every candidate that is a claim: on held-out data, or on the fitted data where none could be
        held out; `NO_GAIN` of a candidate that is not judged by errors.
    evidence
        Evidence in the likelihood of the same data; empty where there is none.
    lack_of_fit
        Lack of fit of the set.
    is_robust
        Whether the noise of the likelihood includes errors of the model, so that it judges a wrong model too.
    carried
        Gains, percent, on other parts of the data than a candidate was fitted to, of those that must act there too.
    over_unrepeated
        What a candidate explains in addition to a constant, in deviations of a mean over repeats; empty where these are
        alike.
    is_random
        Whether process noise is more than a small share of what drives the system.
    is_moved
        Whether what is recorded as driving the system makes its motion more likely.
    """

    gains: Mapping[str, Gain]
    evidence: Mapping[str, Evidence]
    lack_of_fit: Remainder
    is_robust: bool = False
    carried: Mapping[str, float] = field(default_factory=dict)
    over_unrepeated: Mapping[str, float] = field(default_factory=dict)
    is_random: bool = False
    is_moved: bool = True


W = TypeVar("W", bound=Weighed)


@dataclass(frozen=True)
class State(Generic[F, M, W]):
    """A state of the verdict between claims.

    Attributes
    ----------
    verdict
        The verdict to which it belongs: the search by one estimator, with its claims.
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
    tied
        By candidate, that which another estimator has in its place, where neither predicts better.
    """

    verdict: Verdict[F, M, W]
    found: SearchResult[F]
    weighed: W
    rejected: Mapping[str, Rejected]
    settled: frozenset[str]
    steps: tuple[Step, ...] = ()
    replaced: State[Any, Any, Any] | None = None
    tied: Mapping[str, str] = field(default_factory=dict)

    @property
    def search(self) -> Search[F, M]:
        """The search of its verdict."""
        return self.verdict.search

    @property
    def names(self) -> frozenset[str]:
        """The candidates of the set."""
        return frozenset(self.found.without)

    @property
    def claimed(self) -> list[str]:
        """The candidates of the set that are claims."""
        return list(filter(self.search.sets.is_claimed, self.found.without))

    @property
    def likeliest(self) -> F:
        """The fit of the set with which others are compared; the answer may have the values of another estimator."""
        return self.search.sets.fits.get(tuple(sorted(self.names)), self.found.best)


class Verdict(ABC, Generic[F, M, W]):
    """The claims, in the order of `CLAIMS`, and the decisions that they use.

    Parameters
    ----------
    search
        A search that has run.
    """

    def __init__(self, search: Search[F, M]) -> None:
        self.search = search

    @property
    def estimator(self) -> str:
        """How the values of the answer are estimated, in words."""
        return self.search.sets.estimator

    @abstractmethod
    def weigh(self, found: SearchResult[F]) -> W:
        """Return the evidence of held-out data and of the tests of lack of fit on a set."""

    def lack_of_fit(self, state: State[F, M, W]) -> Remainder:
        """Return the lack of fit of a set, in view of the rejected candidates and of the estimator replaced."""
        return state.weighed.lack_of_fit

    def estimated(self, state: State[F, M, W]) -> F:
        """Return the fit of a set with the intervals of its estimates."""
        return state.found.best

    def evidence(self, state: State[F, M, W]) -> dict[str, Evidence | None]:
        """Return the evidence for each claim; None where a lack of fit leaves it to errors of held-out data.

        A likelihood says little of a wrong model. Its errors of prediction, which no fit minimises, say less of the
        data that it was fitted to.
        """
        known, gains = state.weighed.evidence, state.weighed.gains
        held_out = {n for n, e in known.items() if e.on != FITTED and not gains[n].is_none}
        is_wrong = self.lack_of_fit(state).unexplained and not state.weighed.is_robust
        by_errors = held_out if is_wrong else set[str]()
        return {n: None if n in by_errors else known.get(n) for n in gains}

    def errors_chosen(self, state: State[F, M, W]) -> tuple[float, float] | None:
        """Return held-out errors of the nominal model and of the sets that folds choose; None where none chooses."""
        return None

    def is_rarely_chosen(self, state: State[F, M, W], name: str) -> bool:
        """Return whether most folds of the data choose a set without a candidate."""
        return False

    @property
    def currencies(self) -> Sequence[str]:
        """What its models predict, in words, in the order in which estimators are compared by errors of it."""
        return ()

    def errors_in(self, state: State[F, M, W], currency: str, unit: State[Any, Any, Any]) -> Errors | None:
        """Return cross-validated errors of a set on the fitted data, by units of evidence; None where it has none.

        Parameters
        ----------
        currency
            One of `currencies`.
        unit
            State whose noise is the unit of the errors.
        """
        raise NotImplementedError

    def of(self, found: SearchResult[F], replaced: State[Any, Any, Any] | None = None) -> State[F, M, W]:
        """Return the state to which no claim objects.

        Parameters
        ----------
        found
            The result of its search.
        replaced
            The state by another estimator that this one may replace.
        """
        weighed, settled = self.weigh(found), frozenset(found.without)
        state = State(self, found, weighed, {}, settled, replaced=replaced)
        while True:
            for claim in CLAIMS:
                if (changed := getattr(self, claim)(state)) is not None:
                    state = _noted(changed, claim)
                    break
            else:
                return state

    def drop_unmoved(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Reject the weakest candidate of a set by which the recorded inputs do not move the system."""
        return self._without_weakest(state, [] if state.weighed.is_moved else state.claimed)

    def drop_insignificant(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Reject the weakest of the candidates that are not significant at the level of a claim."""
        found, sets = state.found, state.search.sets
        weak = [n for n in state.claimed if not found.p_values[n] < sets.level(found.best)]
        return self._without_weakest(state, weak)

    def drop_errors_of_form(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Reject the weakest of the candidates that gain no more than an error of form, if process noise is large."""
        if not state.weighed.is_random:
            return None
        least, gains = WHOLE * FORM_SHARE, state.weighed.gains
        return self._without_weakest(state, [n for n in gains if gains[n].low < least])

    def drop_unsupported(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Reject the weakest of the candidates that held-out data do not support; see `infer.held_out.is_supported`.

        Where no data could be held out, the fitted data judge.
        """
        known, gains = self.evidence(state), state.weighed.gains
        weak = [n for n, e in known.items() if not is_supported(e, gains[n], alone=len(known) == 1)]
        return self._without_weakest(state, weak)

    def drop_not_carried(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Reject the weakest of the candidates that gain nothing on other parts of the data, where they act too."""
        return self._without_weakest(state, [n for n, gain in state.weighed.carried.items() if not gain > 0.0])

    def drop_unrepeated(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Reject the weakest of the candidates that explain no more than equal repeats differ by in the mean."""
        over = state.weighed.over_unrepeated
        weak = [n for n in state.claimed if n in over and not over[n] > CONFIDENCE_95]
        return self._without_weakest(state, weak)

    def drop_that_predict_no_better(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Reject the weakest candidate if the sets that folds choose predict no better than the nominal model.

        This is asked where there is a lack of fit.
        """
        if not (state.claimed and self.lack_of_fit(state).unexplained):
            return None
        nominal, chosen = self.errors_chosen(state) or (1.0, 0.0)
        return None if chosen < nominal else self._without_weakest(state, state.claimed)

    def settle(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Search the rivals of a set from which candidates were rejected."""
        if state.names == state.settled:
            return None
        found = state.search.settle(tuple(sorted(state.names)), state.rejected)
        return replace(state, found=found, weighed=self.weigh(found), settled=state.names)

    def drop_rarely_chosen(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Reject the weakest of the candidates that most folds of the data do not choose."""
        return self._without_weakest(state, [n for n in state.names if self.is_rarely_chosen(state, n)])

    def drop_of_no_model(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Reject the weakest candidate of a model that is none: see `Sets.is_a_model`."""
        is_none = bool(state.claimed) and not state.search.sets.is_a_model(state.found.best)
        return self._without_weakest(state, state.claimed if is_none else [])

    def drop_impossible(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Reject the weakest candidate of a set with a size that is not physically possible."""
        is_none = bool(state.claimed) and not state.search.sets.is_possible(state.found.best)
        return self._without_weakest(state, state.claimed if is_none else [])

    def drop_uncertain(self, state: State[F, M, W]) -> State[F, M, W] | None:
        """Reject the weakest of the candidates whose size is not certain, by the intervals of the answer."""
        sets, best = state.search.sets, self.estimated(state)
        return self._without_weakest(state, [n for n in state.claimed if not sets.is_certain(best, n)])

    def _without_weakest(self, state: State[F, M, W], some: Sequence[str]) -> State[F, M, W] | None:
        """Return the state without the weakest of some candidates; None if there are none."""
        weakest = min(some, key=lambda n: (_low(state.weighed, n), n), default=None)
        if weakest is None:
            return None
        gain, p_value = state.weighed.gains[weakest], state.found.p_values[weakest]
        rejected = {**state.rejected, weakest: Rejected(p_value, share_in(state.found, weakest), gain)}
        found = state.search.result(tuple(sorted(state.names - {weakest})))
        return replace(state, found=found, weighed=self.weigh(found), rejected=rejected)


def _low(weighed: Weighed, name: str) -> float:
    """Return the low end of a candidate's gain; of one that is not judged by errors, that of its evidence, or 0."""
    gain, evidence = weighed.gains[name], weighed.evidence.get(name)
    return gain.low if not gain.is_none else evidence.low if evidence is not None else 0.0


def _noted(state: State[F, M, W], claim: str) -> State[F, M, W]:
    """Return a state with a claim that changed it; what the claim rejected says so."""
    new = [n for n, one in state.rejected.items() if not one.claim]
    rejected = {n: replace(one, claim=one.claim or claim) for n, one in state.rejected.items()}
    return replace(state, steps=(*state.steps, *(Step(claim, n) for n in new or [""])), rejected=rejected)


def share_in(found: SearchResult[F], name: str) -> float:
    """Return the share of a candidate in the gain of all candidates in log-likelihood."""
    whole = found.nominal.sse - found.best.sse
    return (found.without[name].sse - found.best.sse) / max(whole, 1e-9)


def word_of(has_candidates: bool, lack_of_fit: Remainder) -> str:
    """Return the verdict in a word."""
    return "causes_found" if has_candidates else "unexplained" if lack_of_fit.unexplained else ADEQUATE
