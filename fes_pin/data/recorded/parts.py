"""Where a recording is cut: at a time that starts again, at holes, at rests, where a column changes, at marks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from fes_pin.data.recorded.regular import LONGEST_GAP
from fes_pin.data.table import MIN_ROWS, Table

RESTARTS, HOLES, RESTS = "restarts", "holes", "rests"
"""What a recording is split at by itself; another word names a column, at whose changes it is split."""
REST_S = 0.5
"""Shortest rest, s: a joint turns round within less."""
STILL = 0.01
"""Share of its range within which a reading rests."""


def restarts(time: np.ndarray) -> np.ndarray:
    """Rows at which time starts again: it falls back by more than half of what has passed. Shape (k,)."""
    found, begin = [], 0
    for row in np.flatnonzero(np.diff(time) < 0.0) + 1:
        passed = time[begin:row].max() - time[begin]
        if time[row - 1] - time[row] > 0.5 * passed > 0.0:
            found.append(int(row))
            begin = int(row)
    return np.array(found, dtype=int)


def holes(time: np.ndarray, step_s: float | None = None) -> np.ndarray:
    """Rows before which more than `LONGEST_GAP` steps are missing, shape (k,).

    Steps that grow, as of an encoder that writes a row an edge while a wheel runs out, are long, but not
    next to their neighbours: a hole is so much longer than the shorter of these as well.

    Parameters
    ----------
    time
        Shape (n,), s.
    step_s
        The step that counts; None: the usual one.
    """
    steps = np.diff(time)
    if not (steps > 0.0).any():
        return np.zeros(0, dtype=int)
    usual = max(float(np.median(steps[steps > 0.0])), step_s or 0.0)
    around = np.minimum(np.r_[steps[1:2], steps[:-1]], np.r_[steps[1:], steps[-2:-1]]) if len(steps) > 1 else steps
    return np.flatnonzero((steps > LONGEST_GAP * usual) & (steps > LONGEST_GAP * np.maximum(around, 0.0))) + 1


def rests(time: np.ndarray, readings: Sequence[np.ndarray]) -> list[slice]:
    """Stretches of at least `REST_S` in which every reading stays within `STILL` of its range.

    Parameters
    ----------
    time
        Shape (n,), s.
    readings
        Each of shape (n,).
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d  # noqa: PLC0415 - for recordings that are split at rests

    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    length = max(2, round(REST_S / step)) if step > 0.0 else len(time)
    if length >= len(time):
        return []
    still = np.ones(len(time) - length + 1, dtype=bool)
    for values in readings:
        most, least = (f(values, length, origin=-(length // 2)) for f in (maximum_filter1d, minimum_filter1d))
        still &= (most - least)[: len(still)] <= STILL * np.ptp(values)
    inside = np.convolve(still, np.ones(length), "full") > 0.5
    edges = np.flatnonzero(np.diff(np.r_[False, inside, False].astype(int)))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def changes(values: np.ndarray) -> np.ndarray:
    """Rows at which a column takes another value, shape (k,)."""
    return np.flatnonzero(np.diff(values) != 0.0) + 1


def rows_of(table: Table, rows: slice) -> Table:
    """Some rows of a table."""
    return replace(table, columns={n: v[rows] for n, v in table.columns.items()}, rows=table.rows[rows])


def cut(table: Table, places: np.ndarray) -> list[Table]:
    """The parts of a table between rows at which it is cut; what is too short for a trial is left out."""
    ends = [0, *sorted({int(k) for k in places}), len(table)]
    parts = [slice(a, b) for a, b in pairwise(ends)]
    return [rows_of(table, one) for one in parts if one.stop - one.start >= MIN_ROWS]


def moving(table: Table, readings: Sequence[str]) -> list[Table]:
    """The parts of a table between its rests; a rest between two parts is left out but for its last moment."""
    resting = rests(table.time, [table.columns[n] for n in readings])
    if not resting:
        return [table][: len(table) >= MIN_ROWS]
    begins = [0] if resting[0].start > 0 else []
    begins += [one.stop for one in resting]
    stops = [one.start for one in resting if one.start > 0] + [len(table)]
    slices = [slice(a, b) for a, b in zip(begins, stops, strict=False) if b - a >= MIN_ROWS]
    return [rows_of(table, one) for one in slices]


def without_empty_end(table: Table, shared: Sequence[str] = ()) -> Table:
    """A table down to the last row that holds a sample, as where a longer trial stands next to it; `said` has it.

    Parameters
    ----------
    shared
        Columns that others have as well: they may go on.
    """
    own = [v for n, v in table.columns.items() if n not in shared]
    last = max((int(np.flatnonzero(~np.isnan(v))[-1]) for v in own if not np.isnan(v).all()), default=len(table) - 1)
    if (left := len(table) - last - 1) == 0:
        return table
    said = f"{left} rows of the file below its last sample are left out"
    return replace(rows_of(table, slice(0, last + 1)), said=(*table.said, said))


Ends = tuple[float, float, float]
"""Where a recording begins and ends, and its usual step."""


def ends_of(time: np.ndarray) -> Ends:
    """Ends of a recording with these times, shape (n,), in their unit."""
    return float(time[0]), float(time[-1]), float(np.median(np.abs(np.diff(time))))


def end_at_once(one: Ends, other: Ends) -> bool:
    """Return whether two recordings may be of one time: they overlap, and do not begin at once and end apart.

    What is recorded at once by one logger ends at once, within `LONGEST_GAP` steps.
    """
    gap = LONGEST_GAP * max(one[2], other[2])
    is_later = max(one[0], other[0]) >= min(one[1], other[1])
    return not is_later and (abs(one[0] - other[0]) > gap or abs(one[1] - other[1]) <= gap)
