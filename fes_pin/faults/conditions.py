"""Search of trials of which one may state a wrong condition: as stated, and with the value that was estimated for it.

A trial is restated first where that removes most of the nominal model's error. The search of restated trials is the
answer if it leaves only noise, for no explanation has fewer parameters. Otherwise the trials are searched as stated,
and a trial that is an outlier under the causes that were found is restated then. The penalised likelihood decides: the
causes that the restated trials still need, with the parameter of the condition, against those that the trials as stated
need.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic

from fes_pin.data.trial import Trial
from fes_pin.faults.misread import Misread, restated_trials, takes_most
from fes_pin.infer.fits import F
from fes_pin.infer.levels import PARAMETER_PENALTY, SEPARABLE
from fes_pin.infer.search import M, Search, SearchResult
from fes_pin.models.model import Model
from fes_pin.workers import attempted


@dataclass(frozen=True)
class Restated(Generic[F, M]):
    """A search of trials of which one is restated.

    Attributes
    ----------
    misread
        The condition that was misread, with its estimate.
    trials
        The restated trials.
    search, searched
        Their search, and its result.
    """

    misread: Misread
    trials: list[Trial]
    search: Search[F, M]
    searched: SearchResult[F]


class Conditions(ABC, Generic[F, M]):
    """Search trials, and again with an outlying trial restated; the lower penalised likelihood is the answer.

    Parameters
    ----------
    nominal
        The nominal model, with start values.
    run
        Search of trials.
    """

    def __init__(self, nominal: Model, run: Callable[[list[Trial]], tuple[Search[F, M], SearchResult[F]]]) -> None:
        self.nominal, self.run = nominal, run

    @abstractmethod
    def misread(self, trials: Sequence[Trial], searched: SearchResult[F] | None) -> Misread | None:
        """Return the trial that is an outlier under the causes that were found, or under the nominal model."""

    @abstractmethod
    def saved(self, searched: SearchResult[F], trials: Sequence[Trial], made: Restated[F, M]) -> float:
        """Return by how much the criterion falls from the trials as stated to the restated ones."""

    def leaves_noise(self, made: Restated[F, M]) -> bool:
        """Return whether no test finds a lack of fit in the restated trials."""
        return False

    def is_explained(self, made: Restated[F, M]) -> bool:
        """Return whether no restated trial is an outlier any more.

        Under a model with an error of its own, a trial may be an outlier by that error.
        """
        return True

    def search(self, trials: Sequence[Trial]) -> tuple[Search[F, M], SearchResult[F], Restated[F, M] | None]:
        """Return the search, its result, and the restated trials; None if none was restated."""
        first = self._misread(trials, None)
        made = self._restated(trials, first) if first is not None and takes_most(first) else None  # one is always worst
        if made is not None and not made.searched.without and self.leaves_noise(made):
            return made.search, made.searched, made
        search, searched = self.run(list(trials))
        if made is None and not search.was_stopped:
            # the trial is restated that is an outlier under the causes found, if that explains it
            misread = self._misread(trials, searched) if searched.without else first
            made = None if misread is None else self._restated(trials, misread)
            made = made if made is not None and self.is_explained(made) else None
        if made is None or not self._is_cheaper(search, searched, trials, made):
            return search, searched, None
        return made.search, made.searched, made

    def _is_cheaper(
        self, search: Search[F, M], searched: SearchResult[F], trials: Sequence[Trial], made: Restated[F, M]
    ) -> bool:
        """Return whether the criterion falls by more than the penalty of one condition among all that are stated."""
        if search.was_stopped or made.search.was_stopped:
            return False
        criterion = PARAMETER_PENALTY + 2.0 * math.log(sum(len(self.nominal.rig.stated(t)) for t in trials))
        return self.saved(searched, trials, made) > criterion + SEPARABLE

    def _misread(self, trials: Sequence[Trial], searched: SearchResult[F] | None) -> Misread | None:
        """Return a misreading; None where time is over, or where the model cannot be evaluated."""
        return attempted(lambda: self.misread(trials, searched), None)

    def _restated(self, trials: Sequence[Trial], misread: Misread) -> Restated[F, M]:
        """Return a search of the restated trials, made again with the value by other causes while it finds these."""
        other = restated_trials(self.nominal, trials, misread)
        search, searched = self.run(other)
        tried = [set[str]()]
        while set(searched.without) not in tried and not search.was_stopped:
            tried.append(set(searched.without))
            again = self._misread(trials, searched)
            if again is None or (again.trial, again.condition) != (misread.trial, misread.condition):
                break
            misread, other = again, restated_trials(self.nominal, trials, again)
            search, searched = self.run(other)
        return Restated(misread, other, search, searched)
