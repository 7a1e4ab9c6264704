"""Folds of trials for cross-validation."""

from collections.abc import Sequence

from fes_pin.data.trial import Trial
from fes_pin.infer.held_out import FOLDS, deal


def folds_of(trials: Sequence[Trial], groups: Sequence[str] | None = None, count: int = FOLDS) -> list[list[int]]:
    """Return the trials of each fold, in which every kind and load is spread evenly; none where there is one trial."""
    order = sorted(range(len(trials)), key=lambda i: (trials[i].kind, sorted(trials[i].conditions.items()), i))
    return deal(order, groups, count)
