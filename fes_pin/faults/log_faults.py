"""Faults of a log as candidates: an effort that was recorded late or with noise, readings that were low-passed.

A log has a fault in every sample. Such a fault is therefore named at the level of an effect that is certain, by the
rule for all faults of a record (`infer.corrected`).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from fes_pin.data.log import Log
from fes_pin.data.trial import Trial
from fes_pin.infer.corrected import Answer, Correction, lead_of
from fes_pin.infer.distributions import chi2_tail
from fes_pin.infer.levels import CERTAIN_LEVEL

EFFORT_NOISE, LATE_EFFORT, LOW_PASS = "effort_noise", "late_effort", "low_pass"
A = TypeVar("A", bound=Answer)
R = TypeVar("R")


@dataclass(frozen=True)
class LogFault(Generic[A]):
    """A fault of a log, as it is estimated under an answer.

    Attributes
    ----------
    name
        Of the fault.
    plain, log
        The log of the answer without this fault, and with it as estimated.
    gain
        Gain of the estimate in twice the log-likelihood, given the causes of the answer.
    words
        The estimate in words.
    bare
        The fit of the same causes to the log without the fault, where the answer has it already.
    """

    name: str
    plain: Log
    log: Log
    gain: float
    words: str
    bare: A | None = None

    @property
    def test(self) -> Correction:
        """Its test given the same causes."""
        return Correction(self.name, float(chi2_tail(max(self.gain, 0.0), 1)), CERTAIN_LEVEL, self.words)

    def decided(
        self, answer: R, again: Callable[[Log], R], best: Callable[[R], A], pair: Callable[[A, A], tuple[A, A] | None]
    ) -> tuple[R, Correction]:
        """Return the answer with or without the fault, and the test of the fault.

        A fault that was corrected before any cause was searched must be significant given the causes as well. Its
        answer is compared with the same causes under the log without it.

        Parameters
        ----------
        again
            Returns the answer for another log.
        best
            Returns the fit of an answer.
        pair
            Returns two fits under the same kind of noise; None where they cannot be compared.
        """
        if not self.test.is_significant:
            return (answer if self.bare is None else again(self.plain)), self.test
        other = answer if self.bare is not None else again(self.log)
        both = pair(best(other), self.bare or best(answer))
        lead, least = lead_of(*both, degrees=1) if both else (-math.inf, 0.0)
        test = replace(self.test, lead=lead, least=least)
        return (other if test.is_named else answer), test


INTERPOLATED = (
    "samples were interpolated to equal steps, which acts as a late, noisy or smoothed record: it was corrected"
)
"""What is said of a log in the place of its faults where its samples were interpolated: they may be none of the log."""


def said_of(tests: Sequence[Correction], trials: Sequence[Trial]) -> list[str]:
    """The faults of a log that were corrected, in words, the last one first."""
    named = [one.words for one in reversed(tests) if one.is_named]
    is_interpolated = any(t.as_read is not None and t.as_read.interpolated for t in trials)
    return [INTERPOLATED] if named and is_interpolated else named
