"""A slice of the matrix that would notice a change for the worse: 50 studies hide nothing, 30 hide a cause."""

from __future__ import annotations

from collections.abc import Iterable

from confusion_matrix.plan import Item, groups
from confusion_matrix.table import Record, claims, first

BLANKS, HIDDEN = 50, 30
"""Studies that hide nothing, and that hide a cause: of the table's own kind at least 98 in 100 slices pass."""
MOST_ALARMS = 3
"""Of 50. If 15 % of all such studies raised a false alarm, 95 of 100 slices would show more than this."""
MOST_MISSED = 3
"""Of 30 at d of 40 and more. If 25 % of all such causes were missed, 96 of 100 slices would show more than this."""
CLEAR = 40
"""The least d at which a cause that is missed counts here."""


def hides_nothing(item: Item) -> bool:
    """Whether naming any cause would be a false alarm."""
    return item.kind in ("null", "decoy")


def slice_of(seed: int) -> list[tuple[Item, ...]]:
    """Groups of the first studies of a seed's plan, as many of each sort as are counted."""
    out: list[tuple[Item, ...]] = []
    left = {True: BLANKS, False: HIDDEN}
    for group in groups(seed):
        kept = []
        for item in group:
            nothing = hides_nothing(item)
            if left[nothing] and (nothing or (item.kind == "single" and item.distance >= CLEAR)):
                left[nothing] -= 1
                kept.append(item)
        out += [tuple(kept)] if kept else []
        if not any(left.values()):
            break
    return out


def complaints(records: Iterable[Record]) -> list[str]:
    """What a slice shows that the committed table makes unlikely; empty if nothing."""
    records = list(records)
    out = [f"{r['id']} has no answer: {r['error']}" for r in records if "error" in r]
    good = [r for r in records if "error" not in r]
    alarms = [r["id"] for r in good if r["kind"] in ("null", "decoy") and claims(r)]
    missed = [r["id"] for r in good if r["kind"] == "single" and not first(r)]
    if len(alarms) > MOST_ALARMS:
        out.append(f"{len(alarms)} false alarms, at most {MOST_ALARMS} expected: {', '.join(alarms)}")
    if len(missed) > MOST_MISSED:
        out.append(f"{len(missed)} causes missed, at most {MOST_MISSED} expected: {', '.join(missed)}")
    return out
