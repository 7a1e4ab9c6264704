"""Parts that trials are dealt to, to be held out in turn."""

from __future__ import annotations

from collections.abc import Sequence

from fes_pin.data.trial import Trial

FOLDS = 5
"""Parts that trials are dealt to: each is predicted by the other four, which hold most of what is known."""


def folds_of(trials: Sequence[Trial], count: int = FOLDS) -> list[list[int]]:
    """Trials to hold out together: every kind and every load dealt round."""
    order = sorted(range(len(trials)), key=lambda i: (trials[i].kind, sorted(trials[i].conditions.items()), i))
    count = min(count, len(trials))
    return [sorted(order[k::count]) for k in range(count)]
