"""When a recorded command acted: half a row late if its controller runs at the rate of the log, earlier if faster.

A command that is held for a row acts half a row late in the mean. A controller that runs faster than its log changes
the command between rows, and acts half of its own period late. The delay is estimated with the parameters of the found
set, and kept at half a row where that is within its interval.
"""

from collections.abc import Sequence

from fes_pin.effort.fits import EffortSets, fit_of
from fes_pin.effort.problem import HELD_ROWS, HOLD, EffortFit
from fes_pin.infer.scatter import with_honest_intervals


def with_hold(fits: tuple[EffortFit, EffortFit], every: Sequence[EffortSets]) -> tuple[EffortFit, EffortFit]:
    """Return fits with the delay of efforts as a parameter, here and later in every band, where it is not half a row.

    Parameters
    ----------
    fits
        Of the nominal model and of the found set, in the first band.
    every
        The sets of causes in each band; the first is the one of the search.
    """
    kept = [one.base for one in every]
    if HOLD in kept[0]:
        return fits
    for one in every:
        one.base = {**one.base, HOLD: (0.0, HELD_ROWS)}
    timed = with_honest_intervals(every[0].final(fits[1]))
    if timed.values[HOLD] + timed.reach(HOLD) < HELD_ROWS:
        nominal, found = (fit_of(every[0].problem(f.names, f.forms), f.values, f.forms) for f in fits)
        return nominal, found
    for one, base in zip(every, kept, strict=True):
        one.base = base
    return fits
