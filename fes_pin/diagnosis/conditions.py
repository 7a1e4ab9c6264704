"""Trials of which one may state a condition that it did not have: searched as stated, and with what it must have had.

Where restating a trial takes away most of what the nominal model gets wrong it comes first, and where only noise is
then left nothing can be simpler. Else trials are searched as stated, and one that stands out of what the causes that
were found leave is restated then. A misreading competes with every other explanation by price: the causes that the
restated trials still need, with its own parameter, against those that the trials as stated need.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.misread import Misread, restated_trials, takes_most
from fes_pin.infer.levels import PARAMETER_PENALTY, SEPARABLE
from fes_pin.models.model import Model
from fes_pin.workers import OutOfTime


class Stoppable(Protocol):
    """A search that a limit of time may end."""

    was_stopped: bool


S = TypeVar("S", bound=Stoppable)
R = TypeVar("R")


@dataclass(frozen=True)
class Restated(Generic[S, R]):
    """A search on trials of which one is restated, and why.

    Attributes
    ----------
    misread
        What the trial must have had.
    trials
        Those that were searched, restated.
    search, searched
        On them.
    """

    misread: Misread
    trials: list[Trial]
    search: S
    searched: R


class Conditions(ABC, Generic[S, R]):
    """Searches trials, and again with one of them restated if it stands out and that is the cheaper explanation.

    Parameters
    ----------
    nominal
        With start values.
    run
        Searches trials.
    """

    def __init__(self, nominal: Model, run: Callable[[list[Trial]], tuple[S, R]]) -> None:
        self.nominal, self.run = nominal, run

    @abstractmethod
    def misread(self, trials: Sequence[Trial], searched: R | None) -> Misread | None:
        """The trial that stands out under what was found, or under the nominal model."""

    @abstractmethod
    def has_causes(self, searched: R) -> bool:
        """Whether anything was found."""

    @abstractmethod
    def saved(self, searched: R, trials: Sequence[Trial], made: Restated[S, R]) -> float:
        """By how much the price falls from what was found in trials as stated to what was in the restated ones."""

    def leaves_noise(self, made: Restated[S, R]) -> bool:
        """Whether the restated trials hold nothing but noise, as far as that can be told."""
        return False

    def is_explained(self, made: Restated[S, R]) -> bool:
        """Whether nothing stands out of what the restated trials leave.

        Beside a model that is not right itself, a trial is odd by the model's error.
        """
        return True

    def search(self, trials: Sequence[Trial]) -> tuple[S, R, Restated[S, R] | None]:
        """The search, what it found, and what was restated for it; None if nothing was."""
        first = self._misread(trials, None)
        made = self._restated(trials, first) if first is not None and takes_most(first) else None  # one is always worst
        if made is not None and not self.has_causes(made.searched) and self.leaves_noise(made):
            return made.search, made.searched, made
        search, searched = self.run(list(trials))
        if made is None and not search.was_stopped:
            made = self._by_causes(trials, searched, first)
        if made is None or not self._is_cheaper(search, searched, trials, made):
            return search, searched, None
        return made.search, made.searched, made

    def _by_causes(self, trials: Sequence[Trial], searched: R, first: Misread | None) -> Restated[S, R] | None:
        """A search with the trial restated that stands out by the causes that were found, if it explains that."""
        misread = self._misread(trials, searched) if self.has_causes(searched) else first
        made = None if misread is None else self._restated(trials, misread)
        return made if made is not None and self.is_explained(made) else None

    def _is_cheaper(self, search: S, searched: R, trials: Sequence[Trial], made: Restated[S, R]) -> bool:
        """Whether the price falls by more than that of a condition, of all that are stated."""
        if search.was_stopped or made.search.was_stopped:
            return False
        criterion = PARAMETER_PENALTY + 2.0 * math.log(sum(len(self.nominal.rig.stated(t)) for t in trials))
        return self.saved(searched, trials, made) > criterion + SEPARABLE

    def _misread(self, trials: Sequence[Trial], searched: R | None) -> Misread | None:
        """A misreading; none where time is over, or where the model cannot be calculated with."""
        try:
            return self.misread(trials, searched)
        except (OutOfTime, ArithmeticError, np.linalg.LinAlgError):
            return None

    def _restated(self, trials: Sequence[Trial], misread: Misread) -> Restated[S, R]:
        """A search of the restated trials; once more with the value by the causes that it finds."""
        other = restated_trials(self.nominal, trials, misread)
        search, searched = self.run(other)
        if self.has_causes(searched) and not search.was_stopped:
            again = self._misread(trials, searched)
            if again is not None and (again.trial, again.condition) == (misread.trial, misread.condition):
                misread, other = again, restated_trials(self.nominal, trials, again)
                search, searched = self.run(other)
        return Restated(misread, other, search, searched)
