"""Logs with a row only where something changes: each value holds until the next row."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fes_pin.data.recorded.regular import LONGEST_GAP, resampled
from fes_pin.data.table import Table, increasing_steps

EVENTS = "events"
"""The value of `rows` in [columns.file] that says so."""
FEWEST_ROWS = 20
"""Rows from which the steps of a log show how it was written."""
LONGER, OFTEN = 1.5, 0.01
"""A step this many times the usual shortest one is longer; and the share of such steps in a log of events. A log that
is sampled has equal steps but for holes, which are few."""
ALIKE = 0.1
"""Share of rows that are equal to the one before, but for rounding none in a log of events."""
FEWEST_HOLES, MORE = 3, 3.0
"""Holes that a log of events has at least, and how many times as many as rows that are lost one by one would leave."""
SMOOTH, QUIET = 3.0, 1.5
"""Deviation of a reading, in its usual steps, from which it is smooth; and how many times its largest ordinary step one
changes over a hole at most, where nothing happened in that."""
SHORTEST = 0.05
"""Quantile of the steps that is the period at which a logger looks for changes: the shortest one may be rounded."""


def looking_period(time: np.ndarray, columns: Mapping[str, np.ndarray]) -> float | None:
    """The period at which a logger looked for changes, in the unit of the times; None of a log that is sampled.

    Parameters
    ----------
    time
        Shape (n,).
    columns
        The other columns of numbers, each of shape (n,).
    """
    steps = np.diff(time)
    if len(time) < FEWEST_ROWS or not (steps > 0.0).all() or not columns:
        return None
    shortest = float(np.quantile(steps, SHORTEST))
    longer = steps > LONGER * shortest
    same = np.ones(len(steps), dtype=bool)
    for values in columns.values():
        same &= (np.diff(values) == 0.0) | np.isnan(np.diff(values))
    hole = steps > LONGEST_GAP * float(np.median(steps))
    share, holes = float(np.mean(longer)), int(np.count_nonzero(hole))
    by_loss = len(steps) * share**LONGEST_GAP  # of rows that are lost one by one
    is_log = share > OFTEN and holes >= FEWEST_HOLES + MORE * by_loss and float(np.mean(same)) < ALIKE
    return shortest if is_log and any(_is_quiet(v, hole) for v in columns.values()) else None


def _is_quiet(values: np.ndarray, hole: np.ndarray) -> bool:
    """Return whether a smooth reading goes on after a hole from where it stood; one that is sampled has moved on."""
    change = np.abs(np.diff(values))
    ordinary = change[~hole & (change > 0.0)]
    if len(ordinary) < FEWEST_ROWS or not np.std(values) > SMOOTH * np.median(ordinary):
        return False
    return bool(np.median(change[hole]) <= QUIET * np.max(ordinary))


def sampled_events(table: Table, rate_hz: float) -> Table:
    """A log of events at equal steps, from its first row on: what it holds stays until the next row.

    Raises
    ------
    InputError
        Times that do not increase; as `resampled`.
    """
    increasing_steps(table)
    begin = float(table.time[0])
    counted = replace(table, columns={**table.columns, table.names[0]: table.time - begin})
    held = resampled(counted, table.names, rate_hz)
    words = f"a row only where something changes: {len(table)} rows in {table.time[-1] - begin:.4g} s are held"
    origin = f", times count from {begin:.3f} s" if begin else ""
    said = f"{words} between rows, at {rate_hz:.4g} Hz{origin}"
    return replace(held, said=(*table.said, said))
