"""A named cause as it is told: its parameters, its gain, and what it cannot be told from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fes_pin.data.read_only import ReadOnly
from fes_pin.data.results import shown
from fes_pin.diagnosis.decide.chosen_again import is_chosen
from fes_pin.identify.fit import Fit
from fes_pin.infer.held_out import Evidence, Gain, speaks_for
from fes_pin.infer.levels import CONFIDENCE_95

CELLS = ("value", "std", "unit", "low", "high", "at_bound")
"""Columns of tables of estimates; `low` and `high` are the ends of the 95 % interval."""


@dataclass(frozen=True)
class ParameterEstimate:
    """A value with its standard deviation and unit.

    Attributes
    ----------
    std
        Infinite of a value that is not identified, 0 of one that is held; NaN of one at its bound.
    at_bound
        True of a value at a bound of what the parameter can be. Then its 95 % interval is one-sided: from the bound to
        the other end.
    ends
        Of its 95 % interval, where that is not 1.96 deviations to either side.
    """

    value: float
    std: float
    unit: str
    at_bound: bool = False
    ends: tuple[float, float] | None = None

    @classmethod
    def of(cls, fitted: Fit, name: str, unit: str, wider: float = 1.0) -> ParameterEstimate:
        """A parameter of a fit by name, with its deviation so many times."""
        value = fitted.values[name]
        if name not in fitted.free:
            return cls(value, 0.0, unit)
        if name in fitted.at_bound:
            low, high = (value + wider * (end - value) for end in fitted.interval(name))
            return cls(value, math.nan, unit, True, (low, high))
        return cls(value, wider * fitted.std(name), unit, ends=fitted.interval(name) if wider == 1.0 else None)

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval."""
        half = CONFIDENCE_95 * self.std
        return self.ends or (self.value - half, self.value + half)

    def cells(self) -> tuple[Any, ...]:
        """What tables hold of it, by `CELLS`."""
        return self.value, self.std, self.unit, *self.interval, self.at_bound

    def record(self) -> dict[str, Any]:
        """As JSON files have it: `at_bound` stands only where it is true, with the interval."""
        low, high = (shown(end) for end in self.interval)
        own = {"at_bound": True, "low": low, "high": high} if self.at_bound else {}
        return {"value": shown(self.value), "std": shown(self.std), **own}


@dataclass(frozen=True)
class Cause(ReadOnly):
    """One named cause; see contract: `equivalents` cannot be told from it by these data.

    `chosen_again` says in how many folds it, or an equivalent, was chosen without the trials that were held out there,
    and of how many; None where the study itself holds trials out, or nothing could be.

    `trial` is the only trial that it concerns, if it is not the rig's; `words` then say what happened.
    """

    name: str
    stage: str
    parameters: Mapping[str, ParameterEstimate]
    equivalents: tuple[str, ...]
    p_value: float
    gain_fit: float
    gain_held_out: Gain
    evidence: Evidence | None = None
    chosen_again: tuple[int, int] | None = None
    trial: str | None = None
    words: str = ""

    def __hash__(self) -> int:
        return hash((self.name, self.trial, self.p_value))

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
