"""Readings in counts, as an encoder's: each stands for all that lies within half a count of it."""

from __future__ import annotations

import numpy as np

SAME = 0.1
"""Share of the samples that read the same as the one before, from which a count is no less than the noise: below, what
is read is as good as a number."""
MOST = 2.0**53
"""Counts that a reading may be away from its first: beyond, doubles hold no whole numbers."""
WHOLE = 0.1
"""Share of a count by which a reading may be beside a whole number of them: digits that a file was rounded to."""


@np.errstate(all="ignore")
def count_of(column: np.ndarray) -> float:
    """What one count of a reading is, in its unit; 0.0 where it is not read in counts, or in counts below its noise.

    The count begins as the least difference of neighbours, and is made exact with ever larger differences: after each
    the next are known to a whole number.

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
