"""How it is judged what a search of what differs found: by trials that took no part, and by tests of lack of fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fes_pin.contrasts.grouped import Grouped
from fes_pin.contrasts.left import left_in_groups
from fes_pin.contrasts.models import ContrastModels, ContrastSearch, Found
from fes_pin.data.trial import Trial
from fes_pin.infer.held_out import FOLDS, deal, marginal_cost
from fes_pin.infer.result import FITTED, Evidence, Gain, Remainder
from fes_pin.infer.verdict import State, Verdict, Weighed
from fes_pin.workers import in_parallel


@dataclass(frozen=True)
class ContrastWeighed(Weighed):
    """What trials say of a set; gains are shares of what the set adds to the likelihood of held-out trials.

    Attributes
    ----------
    said
        Of the lack of fit of groups.
    """

    lack_of_fit: Remainder
    said: Sequence[str]


Judgement = State[Grouped, ContrastModels, ContrastWeighed]


class ContrastVerdict(Verdict[Grouped, ContrastModels, ContrastWeighed]):
    """How it is judged what a search found: a change that held-out trials do not confirm is not claimed.

    Parameters
    ----------
    search
        That has run.
    """

    def __init__(self, search: ContrastSearch) -> None:
        super().__init__(search)
        self.claims = (self.drop_unsupported, self.settle)
        self._costs: dict[int, tuple[Grouped, float]] = {}

    def weigh(self, found: Found) -> ContrastWeighed:
        """What held-out trials, and the tests of lack of fit, say of a set."""
        models = self.search.models
        evidence = {} if self.search.was_stopped else self._evidence(found)
        whole = evidence.pop("", Evidence(found.nominal.sse - found.best.sse, 0.0, FITTED)).added
        added = {n: evidence.get(n, Evidence(f.sse - found.best.sse, 0.0, FITTED)) for n, f in found.without.items()}
        gains = {n: _share(one, whole) for n, one in added.items()}
        left, said = left_in_groups(models, found.best, models.seed)
        return ContrastWeighed(gains, evidence, left, said)

    def unsupported(self, state: Judgement) -> list[str]:
        """Changes that held-out trials do not confirm."""
        evidence = state.weighed.evidence
        return [str(i) for i in state.found.best.changes if evidence and not evidence[str(i)].low > 0.0]

    def _evidence(self, found: Found) -> dict[str, Evidence]:
        """What each item, and all together (""), add to twice the log-likelihood of held-out trials; empty without."""
        folds = folds_of(self.search.models.trials)
        if not found.without or not folds:
            return {}
        sets = {"": found.nominal, **found.without}
        costs = in_parallel(lambda one: self._cost_of_held(one, folds), [found.best, *sets.values()])
        return {n: Evidence.of(cost - costs[0]) for n, cost in zip(sets, costs[1:], strict=True)}

    def _cost_of_held(self, one: Grouped, folds: Sequence[Sequence[int]]) -> float:
        """Twice the negative log-likelihood of every fold by fits to the others, what is random as in all trials."""
        if id(one) not in self._costs:
            parts = [self.search.models.maxima.refitted(one, held) for held in folds]
            self._costs[id(one)] = one, sum(_cost(one) - _cost(part) for part in parts)
        return self._costs[id(one)][1]


def folds_of(trials: Mapping[str, Sequence[Trial]]) -> list[list[int]]:
    """Trials to hold out together, by their numbers, all groups end to end; none where a group has one trial.

    Each fold holds out trials of every group, and keeps some of every group.
    """
    every, least = [(g, t) for g, many in trials.items() for t in many], min(map(len, trials.values()))
    order = sorted(range(len(every)), key=lambda i: (every[i][1].kind, sorted(every[i][1].conditions.items()), i))
    return deal(order, [g for g, _ in every], min(FOLDS, least)) if least > 1 else []


def _cost(one: Grouped) -> float:
    return marginal_cost(one.fit, {n: info.scale for n, info in one.model.parameter_info().items()})


def _share(one: Evidence, whole: float) -> Gain:
    """What an item adds to the likelihood, percent of what all items do."""
    percent = 100.0 / max(whole, 1e-9)
    return Gain(percent * one.added, percent * one.low, percent * (2.0 * one.added - one.low), on=one.on)
