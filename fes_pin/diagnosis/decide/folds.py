"""Parts that trials are dealt to, to be held out in turn."""

from __future__ import annotations

from collections.abc import Sequence

from fes_pin.data.trial import Trial
from fes_pin.infer.held_out import deal


def folds_of(trials: Sequence[Trial]) -> list[list[int]]:
    """Trials to hold out together: every kind and every load dealt round; none where there is but one."""
    return deal(sorted(range(len(trials)), key=lambda i: (trials[i].kind, sorted(trials[i].conditions.items()), i)))
