"""Readings in counts, as an encoder's: each is the same for all values within half a count of it."""

import numpy as np

SAME = 0.1
"""Share of equal neighbours above which a count is at least as large as the noise; below it, rounding to counts does
not matter."""
MOST = 2.0**53
"""Most counts between a reading and the first: doubles represent no larger whole numbers."""
WHOLE = 0.1
"""Share of a count by which a reading may differ from a whole number of counts: files are rounded to some digits."""


@np.errstate(all="ignore")
def count_of(column: np.ndarray) -> float:
    """Return the size of one count of a reading; 0.0 where it is not read in counts, or in counts below its noise.

    The estimate starts at the least difference of neighbours, and is refined with ever larger differences, each of
    which determines the number of counts in the next.

    Parameters
    ----------
    column
        Shape (n,); NaN where nothing was measured.
    """
    values = column[np.isfinite(column)]
    steps = np.abs(np.diff(values))
    moved = steps[steps > 0.0]
    if not len(moved) or len(moved) > (1.0 - SAME) * len(steps) or not np.isfinite(moved).all():
        return 0.0
    count, away = float(moved.min()), np.abs(values - values[0])
    count = float(np.mean(moved[moved < 1.5 * count]))
    if not float(away.max()) <= MOST * count:
        return 0.0
    reach = 4.0
    while True:
        near = away[away <= reach * count]
        wholes = np.round(near / count)
        if np.abs(near - wholes * count).max() > WHOLE * count:
            return 0.0
        if wholes.any():
            count = float(near @ wholes / (wholes @ wholes))
        if len(near) == len(away):
            return count
        reach *= 2.0


def begins_of_runs(column: np.ndarray) -> np.ndarray:
    """Return the samples that differ from the one before, the first among them; a missing one differs from all."""
    return np.flatnonzero(np.diff(column, prepend=np.nan) != 0.0)


def lengths_of_runs(column: np.ndarray) -> np.ndarray:
    """Return the number of equal samples in a row at each sample, shape (n,)."""
    lengths = np.diff(np.append(begins_of_runs(column), len(column)))
    return np.repeat(lengths, lengths).astype(float)


@np.errstate(all="ignore")
def hunts(column: np.ndarray) -> np.ndarray:
    """Return the samples of a reading that alternates between two neighbouring counts, shape (n,).

    The rounding error is like noise where a reading passes many counts. Where a motion reverses within each of two
    successive counts, the reading changes by a whole count and the motion by an unknown smaller amount. The error then
    has the sign of the velocity, as dry friction has. Readings that reverse once, as at the end of a swing, or that
    rest, do not belong to these.

    Source: Widrow, Kollar and Liu, Statistical theory of quantization, IEEE Trans. Instrumentation and Measurement 45
    (1996): errors are noise where what is measured is spread over more than a count.
    """
    count = count_of(column)
    if not count:
        return np.zeros(len(column), dtype=bool)
    begins = begins_of_runs(column)
    steps = np.diff(column[begins]) / count
    turns = (np.abs(np.abs(steps[:-1]) - 1.0) < WHOLE) & (np.abs(steps[:-1] + steps[1:]) < WHOLE)
    turns = np.concatenate([[False], turns, [False]])[: len(begins)]
    twice = turns & (np.append(turns[1:], False) | np.insert(turns[:-1], 0, False))
    return np.repeat(twice, np.diff(np.append(begins, len(column))))
