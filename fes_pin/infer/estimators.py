"""Estimators of the same data: each searches and is judged by its own claims, and the one that predicts better answers.

Their fits need have nothing in common. Two estimators are compared by cross-validated errors of the same data, by the
same units, in each currency that both have: what is predicted, as free motion.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fes_pin.infer.held_out import Errors, held_out_gain
from fes_pin.infer.levels import FORM_SHARE, NOTHING_PERCENT
from fes_pin.infer.result import Gain
from fes_pin.infer.text import WHOLE, percent
from fes_pin.infer.verdict import State, Step

AnyState = State[Any, Any, Any]
CHOICE = "choose"
"""Step of an answer by another estimator than the first."""


class Estimator(ABC):
    """A way to estimate data that another estimator was asked about first.

    Attributes
    ----------
    prefers_smaller
        Whether its set answers if it is smaller, where neither predicts better.
    is_independent
        Whether it fits other readings than the first. A larger set of the first must then lessen each error materially
        too, or a smaller set answers.
    """

    prefers_smaller = False
    is_independent = False

    def words(self, state: AnyState) -> str:
        """Return how it estimated a state, in words."""
        return str(state.verdict.estimator)

    @abstractmethod
    def state(self, first: AnyState) -> AnyState | None:
        """Return the state to which none of its claims objects; None where it does not apply or time is up."""


@dataclass(frozen=True)
class Compared:
    """The sets of two estimators in one currency.

    Attributes
    ----------
    before, after
        Errors of the first and of the other.
    gain, loss
        Share of the squared error that the other removes from the first, and the first from the other.
    """

    currency: str
    before: Errors
    after: Errors
    gain: Gain
    loss: Gain

    @property
    def is_better(self) -> bool:
        """Whether the other predicts materially better, with certainty."""
        return self.gain.low > NOTHING_PERCENT

    @property
    def is_worse(self) -> bool:
        """Whether the first does."""
        return self.loss.low > NOTHING_PERCENT

    def __str__(self) -> str:
        errors = f"{percent(self.before.error_percent())} -> {percent(self.after.error_percent())}"
        return f"E of {self.currency} {errors}, gain {self.gain}"


def choose(first: AnyState, others: Sequence[Estimator], seed: int = 0) -> AnyState:
    """Return the state of the first estimator, or of one that predicts materially better.

    Each estimator is compared with the answer so far. It predicts better where the 95 % interval of the share of the
    squared error that it removes is above `NOTHING_PERCENT` in one currency, and it is worse in none. Of sets of
    different sizes the larger predicts better where that share is also above `FORM_SHARE` in each other currency: a
    cause that lessens the error of one alone is an error of form. Noise is not subtracted: each estimator has its own,
    and that of a wrong model is large. Data that the study itself holds out are not used: gains on them would be
    optimistic.

    Where neither predicts better, and the other has one cause in the place of another, the data do not distinguish the
    two: they are equivalents in the state of the first.
    """
    for estimator in others:
        other = estimator.state(first)
        if other is None:
            continue
        compared = _compared(first, other, seed)
        errors = f": {'; '.join(map(str, compared))}"
        if said := _why(first, other, compared, estimator):
            step = Step(CHOICE, words=f"{estimator.words(other)} {said}{errors}")
            first = replace(other, steps=(*first.steps, *other.steps, step))
        elif compared and (any(c.is_better for c in compared) or not any(c.is_worse for c in compared)):
            first = _tied(first, other, f"{estimator.words(other)}{errors}")
    return first


def _why(first: AnyState, other: AnyState, compared: Sequence[Compared], estimator: Estimator) -> str:
    """Return why the other state answers, in words; empty where the first does."""
    if len(other.names) > len(first.names):
        return "predicts better" if _is_felt([c.gain for c in compared]) else ""
    is_worse, is_preferred = any(c.is_worse for c in compared), estimator.prefers_smaller and bool(compared)
    if any(c.is_better for c in compared) and not is_worse:
        return "predicts better"
    if not is_preferred or len(other.names) == len(first.names):
        return ""
    if estimator.is_independent and not _is_felt([c.loss for c in compared]):
        return "has fewer causes, and the further ones do not lessen every error materially"
    return "" if is_worse else "predicts as well with fewer causes"


def _is_felt(shares: Sequence[Gain]) -> bool:
    """Return whether a share is certain in one currency, and more than an error of form may leave in each other one."""
    felt = [share.percent > WHOLE * FORM_SHARE for share in shares]
    return any(share.low > NOTHING_PERCENT and all(felt[:k] + felt[k + 1 :]) for k, share in enumerate(shares))


def _tied(first: AnyState, other: AnyState, errors: str) -> AnyState:
    """Return a state in which the cause that another has in the place of one of its own is an equivalent of that."""
    mine, theirs = sorted(first.names - other.names), sorted(other.names - first.names)
    if not len(mine) == len(theirs) == 1:
        return first
    said = Step(CHOICE, words=f"{theirs[0]} in the place of {mine[0]} predicts neither better nor worse by {errors}")
    return replace(first, tied={**first.tied, mine[0]: theirs[0]}, steps=(*first.steps, said))


def _compared(first: AnyState, other: AnyState, seed: int) -> list[Compared]:
    """Return the comparison of two states in each currency that both have."""
    out = []
    for currency in (one for one in first.verdict.currencies if one in other.verdict.currencies):
        before, after = (one.verdict.errors_in(one, currency, first) for one in (first, other))
        if before is not None and after is not None:
            gains = (held_out_gain(a, a, _without_noise(b), seed) for a, b in ((before, after), (after, before)))
            out.append(Compared(currency, before, after, *gains))
    return out


def _without_noise(errors: Errors) -> Errors:
    """Return errors of which none is taken for noise."""
    none = np.zeros_like(errors.noise)
    return replace(errors, noise=none, variances=none + np.finfo(float).tiny)
