"""Search of trials of which one may state a wrong condition: as stated, and with the value that was estimated for it.

A trial is restated first where that removes most of the nominal model's error. The search of restated trials is the
answer if it leaves only noise, for no explanation has fewer parameters. Otherwise the trials are searched as stated,
and a trial that is an outlier under the causes that were found is restated then. The penalised likelihood decides: the
causes that the restated trials still need, with the parameter of the condition, against those that the trials as stated
need.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic

from fes_pin.data.trial import Trial
from fes_pin.faults.misread import NAME, Misread, restated_trials, takes_most
from fes_pin.infer.corrected import Answer, Correction, lead_of
from fes_pin.infer.fits import F
from fes_pin.infer.levels import CLAIM_LEVEL
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

    Attributes
    ----------
    tests
        The tests of the conditions that were doubted.
    """

    def __init__(self, nominal: Model, run: Callable[[list[Trial]], tuple[Search[F, M], SearchResult[F]]]) -> None:
        self.nominal, self.run = nominal, run
        self.tests: list[Correction] = []

    @abstractmethod
    def misread(self, trials: Sequence[Trial], searched: SearchResult[F] | None) -> Misread | None:
        """Return the trial that is an outlier under the causes that were found, or under the nominal model."""

    @abstractmethod
    def pair(
        self, made: Restated[F, M], trials: Sequence[Trial], searched: SearchResult[F] | None
    ) -> tuple[Answer, Answer]:
        """Return the fits of the answers for the restated trials and for the trials as stated, under the same noise.

        Where the trials as stated were not searched, the second is a fit of the same set.
        """

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
            self._tested(made, trials, None)
            return made.search, made.searched, made
        search, searched = self.run(list(trials))
        if made is None and not search.was_stopped:
            made = self._under_causes(trials, searched, first)
        if made is None or search.was_stopped or made.search.was_stopped:
            return search, searched, None
        named = self._tested(made, trials, searched).is_named
        return (made.search, made.searched, made) if named else (search, searched, None)

    def _under_causes(
        self, trials: Sequence[Trial], searched: SearchResult[F], first: Misread | None
    ) -> Restated[F, M] | None:
        """Return the search with the trial restated that is an outlier under the causes found, if that explains it."""
        misread = self._misread(trials, searched) if searched.without else first
        made = None if misread is None else self._restated(trials, misread)
        return made if made is not None and self.is_explained(made) else None

    def _tested(self, made: Restated[F, M], trials: Sequence[Trial], searched: SearchResult[F] | None) -> Correction:
        """Return the test of a misreading, one condition among all that are stated."""
        misread, stated = made.misread, sum(len(self.nominal.rig.stated(t)) for t in trials)
        lead = lead_of(*self.pair(made, trials, searched), degrees=1, tried=stated)
        self.tests.append(Correction(NAME, misread.p_value, CLAIM_LEVEL, misread.words, *lead))
        return self.tests[-1]

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
