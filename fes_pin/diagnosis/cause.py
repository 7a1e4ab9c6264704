"""A named cause as it is told: its parameters, its gain, and what it cannot be told from."""

from __future__ import annotations

from dataclasses import dataclass

from fes_pin.diagnosis.decide.chosen_again import is_chosen
from fes_pin.diagnosis.decide.held_out import Evidence, Gain, speaks_for


@dataclass(frozen=True)
class ParameterEstimate:
    """A value with its standard deviation (infinite: not identified) and unit."""

    value: float
    std: float
    unit: str


@dataclass(frozen=True)
class Cause:
    """One named cause; see contract: `equivalents` cannot be told from it by these data.

    `chosen_again` says in how many folds it, or an equivalent, was chosen without the trials that were held out there,
    and of how many; None where the study itself holds trials out, or nothing could be.

    `trial` is the only trial that it concerns, if it is not the rig's; `words` then say what happened.
    """

    name: str
    stage: str
    parameters: dict[str, ParameterEstimate]
    equivalents: tuple[str, ...]
    p_value: float
    gain_fit: float
    gain_held_out: Gain
    evidence: Evidence | None = None
    chosen_again: tuple[int, int] | None = None
    trial: str | None = None
    words: str = ""

    @property
    def chosen_in_some(self) -> tuple[int, int] | None:
        """`chosen_again` where some folds choose something else; None where none does."""
        again = self.chosen_again
        return again if again is not None and again[0] < again[1] else None

    def helps(self, complete: bool, alone: bool) -> bool:
        """True if trials that took no part speak for it, and it is chosen without them as well.

        See `decide.held_out.speaks_for`.
        """
        spoken_for = speaks_for(self.evidence if complete else None, self.gain_held_out, alone)
        return spoken_for and is_chosen(self.chosen_again)


@dataclass(frozen=True)
class Ranked:
    """A candidate beside the others: how far the whole fit falls short of the best with it in the cause's place."""

    names: tuple[str, ...]
    shortfall: float
