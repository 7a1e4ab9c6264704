"""Estimators of the same data: each searches and is judged by its own claims, and the one that predicts better answers.

Their fits need have nothing in common. Two estimators are compared by cross-validated errors of the same data, by the
same units, in the first currency of the first that the other has too: what is predicted, as free motion.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fes_pin.infer.held_out import Errors, held_out_gain
from fes_pin.infer.levels import NOTHING_PERCENT
from fes_pin.infer.text import percent
from fes_pin.infer.verdict import State, Step

AnyState = State[Any, Any, Any]
CHOICE = "choose"
"""Step of an answer by another estimator than the first."""


class Estimator(ABC):
    """A way to estimate data that another estimator was asked about first."""

    @abstractmethod
    def state(self, first: AnyState) -> AnyState | None:
        """Return the state to which none of its claims objects; None where it does not apply or time is up."""


def choose(first: AnyState, others: Sequence[Estimator], seed: int = 0) -> AnyState:
    """Return the state of the first estimator, or of one that predicts materially better; the first such one.

    It predicts better where the 95 % interval of the share of the squared error that it removes is above
    `NOTHING_PERCENT`. Noise is not subtracted: each estimator has its own, and that of a wrong model is large. Data
    that the study itself holds out are not used: gains on them would be optimistic.
    """
    for estimator in others:
        other = estimator.state(first)
        if other is None:
            continue
        both = (one for one in first.verdict.currencies if one in other.verdict.currencies)
        if (currency := next(both, None)) is None:
            continue
        before, after = (one.verdict.errors_in(one, currency, first) for one in (first, other))
        gain = held_out_gain(before, before, _without_noise(after), seed)
        if gain.low > NOTHING_PERCENT:
            errors = f"E of {currency} {percent(before.error_percent())} -> {percent(after.error_percent())}"
            step = Step(CHOICE, words=f"{other.search.sets.estimator} predicts better: {errors}, gain {gain}")
            return replace(other, steps=(*first.steps, *other.steps, step))
    return first


def _without_noise(errors: Errors) -> Errors:
    """Return errors of which none is taken for noise."""
    none = np.zeros_like(errors.noise)
    return replace(errors, noise=none, variances=none + np.finfo(float).tiny)
