"""When a recorded command acted: half a row late if its controller runs at the rate of the log, earlier if faster.

A command that is held for a row acts half a row late in the mean. A controller that runs faster than its log changes
the command between rows, and acts half of its own period late. The delay is estimated with the parameters of the found
set, and kept at half a row where that is within its interval.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from fes_pin.effort.fits import EffortSets, fit_of
from fes_pin.effort.problem import HELD_ROWS, HOLD, EffortFit
from fes_pin.infer.scatter import with_honest_intervals


@contextmanager
def timed(fitted: EffortFit, every: Sequence[EffortSets]) -> Iterator[EffortFit]:
    """Give a fit with the delay of efforts as a parameter, here and in every band, where it is not half a row.

    Parameters
    ----------
    fitted
        In the first band.
    every
        The sets of causes in each band; the first is the one of the search.
    """
    kept = [one.base for one in every]
    if HOLD in kept[0]:
        yield fitted
        return
    for one in every:
        one.base = {**one.base, HOLD: (0.0, HELD_ROWS)}
    try:
        with_delay = with_honest_intervals(every[0].final(fitted))
        if with_delay.values[HOLD] + with_delay.reach(HOLD) < HELD_ROWS:
            yield fit_of(every[0].problem(fitted.names, fitted.forms), fitted.values, fitted.forms)
            return
    finally:
        for one, base in zip(every, kept, strict=True):
            one.base = base
    yield fitted
