"""A contrast in which one trial was not run as it states: restated if that is cheaper than any change of the rig."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fes_pin.contrasts.fits import Fits
from fes_pin.contrasts.grouped import Item
from fes_pin.contrasts.search import ContrastFound
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.misread import NAME, Misread, find_misread, restated_trials
from fes_pin.infer.levels import CLAIM_LEVEL, PARAMETER_PRICE, SEPARABLE
from fes_pin.infer.result import Change, ParameterEstimate
from fes_pin.models.model import Model

ROUNDS = 3
"""Searches with one trial restated: the first set that is found beside it is nearly always the last."""

Trials = Mapping[str, Sequence[Trial]]
RunContrast = Callable[[Trials], tuple[Fits, ContrastFound]]


@dataclass(frozen=True)
class ContrastSearched:
    """A search that has run.

    Attributes
    ----------
    fits, found
        What was searched, and found.
    group, misread
        The group of a trial that was restated, and what it must have had; None if none was.
    """

    fits: Fits
    found: ContrastFound
    group: str | None = None
    misread: Misread | None = None


def contrast_with_conditions(nominal: Model, trials: Trials, run: RunContrast) -> ContrastSearched:
    """Search groups of trials, and again with a trial restated that stands out of its own group."""
    told = [(g, one) for g, many in trials.items() if (one := _found(nominal, many, len(trials))) is not None]
    if not told:
        return ContrastSearched(*run(trials))
    group, misread = min(told, key=lambda pair: pair[1].p_value)
    after = _restated(nominal, trials, group, misread, run)
    found = after.found
    if not found.best.items:  # nothing changed, and nothing is wrong: no explanation is simpler
        return after
    as_stated = ContrastSearched(*run(trials))
    stated = sum(len(nominal.rig.stated(t)) for many in trials.values() for t in many)
    price = PARAMETER_PRICE + 2.0 * math.log(stated)
    best = replace(as_stated.found.best, weights=found.best.weights)
    before = as_stated.fits.converged(best.model, best.items, best.weights, best.fit.unknowns)
    return after if before.price - found.best.price > price + SEPARABLE else as_stated


def _restated(nominal: Model, trials: Trials, group: str, misread: Misread, run: RunContrast) -> ContrastSearched:
    """A search with a trial restated; again with the value that it has beside what is found, until that stays."""
    beside: set[Item] = set()
    for _ in range(ROUNDS):
        made = ContrastSearched(*run(_with(nominal, trials, group, misread)), group, misread)
        best = made.found.best
        again = _found(best.model.models[group], trials[group], len(trials)) if set(best.items) != beside else None
        if again is None or (again.trial, again.condition) != (misread.trial, misread.condition):
            break
        misread, beside = again, set(best.items)
    return made


def _with(nominal: Model, trials: Trials, group: str, misread: Misread) -> Trials:
    return {**trials, group: restated_trials(nominal, trials[group], misread)}


def _found(nominal: Model, trials: Sequence[Trial], groups: int) -> Misread | None:
    """The trial of a group that stands out of it, beside the other groups that are asked as well."""
    try:
        found = find_misread(nominal, trials)
    except (ArithmeticError, np.linalg.LinAlgError):
        return None
    if found is None or not groups * found.p_value < CLAIM_LEVEL:
        return None
    return replace(found, p_value=groups * found.p_value)


def misread_change(searched: ContrastSearched) -> list[Change]:
    """The trial that was restated, as a change of its group; none if none was."""
    one, group = searched.misread, searched.group
    if one is None or group is None:
        return []
    known = searched.fits.nominal.rig.schema.conditions.get(one.condition)
    estimate = ParameterEstimate(one.value, one.std, known.unit if known is not None else "m")
    return [
        Change(
            name=NAME,
            kind="condition",
            group=group,
            words=one.words,
            parameters={one.condition: {group: estimate}},
            equivalents=(),
            p_value=one.p_value,
            trial=one.trial,
        )
    ]
