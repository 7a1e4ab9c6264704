"""By how much an effort was written down after it acted, or before.

A log that asks a controller less often than it works holds an effort for as long as a row lasts, and the rig seems to
answer before it is driven: by half a row where rows are regular, by one and more where they are not. What was asked for
between rows none of them holds; as far as it followed what is smooth, a spline through the rows tells it. When within
its row an effort that answers the reading begins to act no log says; it is at most half a row later than the reading,
for what is later is a lag. How late an effort is the likelihood says, beside the model that was found.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from scipy.optimize import minimize_scalar

from fes_pin.data.log import Log
from fes_pin.identify.fit import Fit
from fes_pin.identify.levels import CERTAIN_GAIN
from fes_pin.identify.turns import maximum_from
from fes_pin.workers import in_parallel

LEAST_ROWS = 0.25
"""The least: of a log that asks in every second sample of a controller, which holds for half a row."""
MOST_ROWS = 2.0
"""Rows of a log by which an effort may be late: one that it is held when it is written down, and one until the next."""
MOST_EARLY_ROWS = 0.5
"""Rows by which it may act later than written: what is more is a lag, see `SensorLag.smallest`."""


@dataclass(frozen=True)
class Lateness:
    """What a log says of when efforts acted, and the cost of trials with efforts when they did."""

    log: Log
    cost: float


def lateness_of(fitted: Fit, row_s: float, as_logged: bool = False) -> Lateness | None:
    """How late the efforts of a fit's trials are; None where they are in time.

    Parameters
    ----------
    fitted
        By the likelihood, of a rig that an effort drives.
    row_s
        Time step of the log.
    as_logged
        Whether rows are as they were logged, and no averages: then efforts may also act later than written, or between
        rows.
    """
    tried: dict[Log, float] = {}

    def cost(log: Log) -> float:
        if log not in tried:
            tried[log] = maximum_from(fitted, [log.applied(t) for t in fitted.trials]).sse
        return tried[log]

    ways = _WAYS if as_logged else _WAYS[:1]
    least = [way(LEAST_ROWS * row_s) for way, _ in ways]
    begun = in_parallel(cost, least)
    if min(begun) > fitted.sse - CERTAIN_GAIN:
        return None
    worth = [one for one, at_least in zip(ways, begun, strict=True) if at_least < fitted.sse]
    for way, most in worth:
        minimize_scalar(
            lambda s, way=way: cost(way(float(s))),
            bounds=(0.0, most * row_s),
            method="bounded",
            options={"xatol": 0.02 * row_s},
        )
    best = min(tried, key=lambda log: tried[log])
    return Lateness(best, tried[best])


_WAYS: tuple[tuple[Callable[[float], Log], float], ...] = (
    (lambda late_s: Log(effort_late_s=late_s), MOST_ROWS),
    (lambda early_s: Log(effort_late_s=-early_s), MOST_EARLY_ROWS),
    (lambda late_s: Log(effort_over_s=2.0 * late_s), MOST_EARLY_ROWS),
)
"""How efforts can be late by some time, and by how many rows at most: a controller that works often is late by half."""


def words_of_lateness(log: Log) -> str:
    """What is to be said of efforts that were moved, or read between rows."""
    if log.effort_over_s:
        return (
            f"the effort was written down less often than the controller acted, and was read between the rows, over "
            f"{1e3 * log.effort_over_s:.2g} ms from each"
        )
    late_s = log.effort_late_s
    when = "after" if late_s > 0.0 else "before"
    return f"the effort was written down {1e3 * abs(late_s):.2g} ms {when} it acted, and was moved to when it did"
