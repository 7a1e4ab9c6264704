"""The search that a rig's trials need: by free simulation, or by the likelihood of predictions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial, derived_trial
from fes_pin.diagnosis.parts import in_parts
from fes_pin.diagnosis.search.likelihood_models import Found, LikelihoodModels, LikelihoodSearch
from fes_pin.diagnosis.search.simulation_search import Searched, SimulationSearch
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect

Search = SimulationSearch | LikelihoodSearch
Result = Searched | Found


class Searches:
    """Searches of one study, each of its own trials.

    Parameters
    ----------
    nominal
        With start values.
    train, recorded
        The trials that are searched, and the same before any thinning.
    test
        Those that the study holds out.
    driven
        True if the rig's effort answers its reading.
    effects
        The causes that are looked for.
    seed, progress, horizon_s
        As of a diagnosis and its study.

    Attributes
    ----------
    last
        The search that ran last, or runs.
    """

    def __init__(
        self,
        nominal: Model,
        train: Sequence[Trial],
        recorded: Sequence[Trial],
        test: Sequence[Trial],
        driven: bool,
        effects: Sequence[type[Effect]],
        seed: int,
        progress: Callable[[float, str], None],
        horizon_s: float | None,
    ) -> None:
        self.nominal, self.train, self.recorded, self.test = nominal, tuple(train), tuple(recorded), tuple(test)
        self.driven = driven
        self._effects, self._seed, self._progress, self._horizon_s = effects, seed, progress, horizon_s
        self.last: Search | None = None

    def run(self, trials: Sequence[Trial]) -> tuple[Search, Result]:
        """Search trials: those of the study, some of them restated."""
        self.last = search = self._begun(trials)
        found: Result = search.run()
        if isinstance(found, Searched) and self._is_undecided(found):
            return self.by_likelihood(trials, self.driven)
        return search, found

    def by_likelihood(self, trials: Sequence[Trial], answered: bool) -> tuple[LikelihoodSearch, Found]:
        """Search trials by the likelihood, whatever drives the rig; `answered` if its effort answers its reading."""
        self.last = search = self._by_likelihood(trials, answered)
        return search, search.run()

    def _begun(self, trials: Sequence[Trial]) -> Search:
        if self.driven or any(t.kind == IMPOSED for t in trials):
            return self._by_likelihood(trials, self.driven)
        now = {id(old): new for old, new in zip(self.train, trials, strict=True)}
        stated = {t.name: t.conditions for t in trials}
        recorded = [now.get(id(t)) or _with(t, stated.get(t.name, t.conditions)) for t in self.recorded]
        return SimulationSearch(self.nominal, trials, recorded, self._seed, self._progress, self._effects)

    def _by_likelihood(self, trials: Sequence[Trial], answered: bool) -> LikelihoodSearch:
        parts = in_parts(self.nominal.rig, trials)
        models = LikelihoodModels(self.nominal, parts, self._effects, answered, self._seed, self._horizon_s)
        return LikelihoodSearch(models, self._progress)

    def _is_undecided(self, found: Searched) -> bool:
        """True where no set of causes leaves only noise of the reading, and there is no second trial to compare by.

        Something acts in the rig itself then; it is a random effort to the likelihood, which one trial is enough for.
        """
        trials = found.nominal.trials
        if found.complete or found.stopped or len(trials) > 1 or self.test:
            return False
        return bool(found.nominal.model.rig.driving_sizes(trials))


def _with(trial: Trial, conditions: Mapping[str, float]) -> Trial:
    return trial if trial.conditions == conditions else derived_trial(trial, conditions=conditions)


__all__ = ["Result", "Search", "Searches"]
