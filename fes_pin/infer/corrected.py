"""Faults of a record as candidates: when the answer for a corrected record takes the place of that for the record.

Every fault is judged by one rule, whatever was recorded and whoever asks. A fault is named if

1. its gain in twice the log-likelihood, given the same causes, is significant over all values that were tried,
2. the answer for the corrected record, with the causes that this one needs, has the lower penalised likelihood of the
   same readings, by more than what distinguishes two models (`scatter.least_apart`).
"""

import math
from dataclasses import dataclass
from typing import Any, Protocol

from fes_pin.infer.levels import PARAMETER_PENALTY
from fes_pin.infer.result import p_shown, shown
from fes_pin.infer.scatter import Residuals, least_apart
from fes_pin.infer.text import probability


class Answer(Residuals, Protocol):
    """A fit with a penalised likelihood."""

    @property
    def criterion(self) -> float:
        """Twice the negative log-likelihood with its penalties."""


@dataclass(frozen=True)
class Correction:
    """A fault of a record, as it was tested.

    Attributes
    ----------
    name
        Of the fault.
    p_value, level
        Family-wise p-value of its gain given the same causes, and the level of a claim.
    words
        What was estimated.
    lead, least
        Fall of the penalised likelihood from the answer for the record to that for the corrected record, and the fall
        that distinguishes them; NaN where no answer was searched for the corrected record, infinite where two answers
        have noise of other kinds.
    """

    name: str
    p_value: float
    level: float
    words: str = ""
    lead: float = math.nan
    least: float = math.nan

    @property
    def is_significant(self) -> bool:
        """Whether its gain given the same causes is significant."""
        return self.p_value < self.level

    @property
    def is_named(self) -> bool:
        """Whether the answer for the corrected record takes the place of that for the record."""
        return self.is_significant and self.lead > self.least

    def __str__(self) -> str:
        test = f"{probability(self.p_value)}, level {self.level:g}"
        if not math.isfinite(self.lead):
            return f"{test}: {'the answers cannot be compared' if self.is_significant else 'not significant'}"
        why = f"twice the penalised log-likelihood {'rises' if self.lead > 0.0 else 'falls'} by {abs(self.lead):.3g}"
        return f"{self.words}: {why}, {self.least:.3g} distinguish ({test})"

    def record(self) -> dict[str, Any]:
        """As JSON files have it."""
        searched = {} if not math.isfinite(self.lead) else {"lead": shown(self.lead), "least_lead": shown(self.least)}
        return {"named": self.is_named, "p_value": p_shown(self.p_value), "level": self.level, **searched}


def lead_of(corrected: Answer, recorded: Answer, degrees: int = 0, tried: int = 1) -> tuple[float, float]:
    """Return the lead of the answer for a corrected record, and the lead that distinguishes the two.

    Parameters
    ----------
    corrected, recorded
        Fits of both answers to the same readings, under the same kind of noise.
    degrees
        Parameters of the fault that the fit of the corrected record does not count.
    tried
        Number of places of the record that may have the fault.
    """
    penalty = PARAMETER_PENALTY * degrees + 2.0 * math.log(tried)
    lead = recorded.criterion - corrected.criterion - penalty
    pair = (corrected, recorded) if corrected.sse < recorded.sse else (recorded, corrected)
    return lead, least_apart(*pair)
