"""What a reader must know of names that rest on little."""

from __future__ import annotations

from fes_pin.infer.held_out import FOLDS


def few_trials(count: int) -> list[str]:
    """What a reader must know of names that rest on so many trials; nothing if they are many."""
    few = f"the names rest on {count} trial{'s' if count > 1 else ''}, fewer than {FOLDS}: more may change them"
    return [few] * (count < FOLDS)
