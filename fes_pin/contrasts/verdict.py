"""The verdict on changes: by held-out trials and by tests of lack of fit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fes_pin.contrasts.grouped import Grouped
from fes_pin.contrasts.models import ContrastModels, ContrastSearch, Found
from fes_pin.data.trial import Trial
from fes_pin.infer.held_out import FOLDS, marginal_cost
from fes_pin.infer.levels import CLAIM_LEVEL
from fes_pin.infer.result import NO_GAIN, Evidence, Remainder
from fes_pin.infer.verdict import State, Verdict, Weighed
from fes_pin.prepare.measured import folds_of
from fes_pin.remainder.lack_of_fit import lack_of_fit
from fes_pin.workers import in_parallel


@dataclass(frozen=True)
class ContrastWeighed(Weighed):
    """Evidence of trials on a set, by the likelihood alone: the claims are the changes.

    Attributes
    ----------
    said
        Warnings about the lack of fit of groups.
    """

    said: Sequence[str] = ()


Judgement = State[Grouped, ContrastModels, ContrastWeighed]


class ContrastVerdict(Verdict[Grouped, ContrastModels, ContrastWeighed]):
    """The verdict on what a search found: a change that held-out trials do not confirm is not named.

    Parameters
    ----------
    search
        A search that has run.
    """

    def __init__(self, search: ContrastSearch) -> None:
        super().__init__(search)
        self._costs: dict[int, tuple[Grouped, float]] = {}

    def weigh(self, found: Found) -> ContrastWeighed:
        """Return the evidence of held-out trials and of the tests of lack of fit on a set."""
        evidence = {} if self.search.was_stopped else self._evidence(found)
        left, said = left_in_groups(self.search.models, found.best)
        return ContrastWeighed(dict.fromkeys(map(str, found.best.changes), NO_GAIN), evidence, left, said=said)

    def _evidence(self, found: Found) -> dict[str, Evidence]:
        """Return the evidence for each change in held-out trials; empty without these."""
        folds = folds_of_groups(self.search.models.trials)
        if not found.best.changes or not folds:
            return {}
        without = {n: found.without[n] for n in map(str, found.best.changes)}
        costs = in_parallel(lambda one: self._cost_of_held(one, folds), [found.best, *without.values()])
        return {n: Evidence.of(cost - costs[0]) for n, cost in zip(without, costs[1:], strict=True)}

    def _cost_of_held(self, one: Grouped, folds: Sequence[Sequence[int]]) -> float:
        """Return twice the negative log-likelihood of folds by fits to the others, with the noise of all trials."""
        if id(one) not in self._costs:
            parts = [self.search.models.maxima.refitted(one, held) for held in folds]
            self._costs[id(one)] = one, sum(_cost(one) - _cost(part) for part in parts)
        return self._costs[id(one)][1]


def folds_of_groups(trials: Mapping[str, Sequence[Trial]]) -> list[list[int]]:
    """Return the trials of each fold, by their numbers, all groups end to end; none where a group has one trial.

    Each fold holds out trials of every group, and keeps some of every group.
    """
    every, least = [(g, t) for g, many in trials.items() for t in many], min(map(len, trials.values()))
    return folds_of([t for _, t in every], [g for g, _ in every], min(FOLDS, least)) if least > 1 else []


def _cost(one: Grouped) -> float:
    return marginal_cost(one, {n: info.scale for n, info in one.grouped.parameter_info().items()})


def left_in_groups(models: ContrastModels, best: Grouped) -> tuple[Remainder, list[str]]:
    """Return the lack of fit in some groups alone, and warnings; one of all groups is an error of the model."""
    parts = in_parallel(lambda g: models.maxima.part(best, g), list(models.trials))
    each = dict(zip(models.trials, in_parallel(lack_of_fit, parts), strict=True))
    each = {g: _in_single_trials(models, best, g, r) if r.unexplained else r for g, r in each.items()}
    least = min(each.values(), key=lambda r: r.p_value)
    open_ = [g for g, r in each.items() if r.unexplained]
    p = min(1.0, len(each) * least.p_value)
    if len(open_) == len(each):
        words = "the model leaves something unexplained in every group; `diagnose` says what"
        return Remainder(True, p, least.where, CLAIM_LEVEL, everywhere=True), [words]
    if not open_ or not p < CLAIM_LEVEL:
        return Remainder(False, p, None, CLAIM_LEVEL), []
    return Remainder(True, p, least.where, CLAIM_LEVEL), [f"lack of fit in the group {g}" for g in open_]


def _in_single_trials(models: ContrastModels, best: Grouped, group: str, left: Remainder) -> Remainder:
    """Return the lack of fit of a group, if half of its trials have one with nominal values of their own.

    Trials that differ in strength or friction, within a group too, have a lack of fit with shared values.
    """
    alone = in_parallel(lambda k: models.maxima.part(best, group, k), range(len(models.trials[group])))
    p = min(1.0, 2.0 * float(np.median([lack_of_fit(one).p_value for one in alone])))
    return replace(left, unexplained=p < CLAIM_LEVEL, p_value=max(left.p_value, p))
