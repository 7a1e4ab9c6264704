"""The warning for names that rest on few trials."""

from __future__ import annotations

from fes_pin.infer.held_out import FOLDS


def few_trials(count: int) -> list[str]:
    """Return a warning that the names rest on few trials; none if there are many."""
    few = f"the names rest on {count} trial{'s' if count > 1 else ''}, fewer than {FOLDS}: more may change them"
    return [few] * (count < FOLDS)
