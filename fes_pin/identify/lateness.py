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
from fes_pin.identify.likelihood_fit import LikelihoodFit, maximum_from
from fes_pin.identify.simultaneous import cost_of_answers
from fes_pin.infer.levels import CERTAIN_GAIN
from fes_pin.workers import in_parallel

LEAST_ROWS = 0.25
"""The least: of a log that asks in every second sample of a controller, which holds for half a row."""
MOST_ROWS = 2.0
"""Rows of a log by which an effort may be late: one that it is held when it is written down, and one until the next."""
MOST_EARLY_ROWS = 0.5
"""Rows by which it may act later than written: what is more is a lag, see `SensorLag.smallest`."""

_Way = tuple[Callable[[float], Log], float]


@dataclass(frozen=True)
class Lateness:
    """What a log says of when efforts acted, and the cost of trials with efforts when they did.

    Attributes
    ----------
    log
        Half way between when they acted by the innovations alone, and by these and what the efforts answer: one is too
        early and the other too late, see `identify.simultaneous`.
    at_most
        The latter.
    """

    log: Log
    cost: float
    at_most: Log


def lateness_of(fitted: LikelihoodFit, row_s: float, as_logged: bool = False) -> Lateness | None:
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
    tried: dict[Log, LikelihoodFit] = {}

    def moved(log: Log) -> LikelihoodFit:
        if log not in tried:
            tried[log] = maximum_from(fitted, [log.applied(t) for t in fitted.trials])
        return tried[log]

    def lowest(way: _Way, cost: Callable[[Log], float]) -> Log:
        at, most = way
        bounds, options = (0.0, most * row_s), {"xatol": 0.02 * row_s}
        found = minimize_scalar(lambda s: cost(at(float(s))), bounds=bounds, method="bounded", options=options)
        return at(float(found.x))

    ways = _WAYS if as_logged else _WAYS[:1]
    begun = in_parallel(lambda way: moved(way[0](LEAST_ROWS * row_s)).sse, ways)
    if min(begun) > fitted.sse - CERTAIN_GAIN:
        return None
    worth = [way for way, sse in zip(ways, begun, strict=True) if sse < fitted.sse]
    found = {lowest(way, lambda log: moved(log).sse): way for way in worth}
    best = min(found, key=lambda log: moved(log).sse)
    answering = lowest(found[best], lambda log: moved(log).sse + cost_of_answers(moved(log), fitted.trials, log))
    between = _middle(best, answering)
    return Lateness(between, moved(between).sse, answering)


def _middle(one: Log, other: Log) -> Log:
    """The log half way between two of the same kind."""
    late_s, over_s = (0.5 * (getattr(one, n) + getattr(other, n)) for n in ("effort_late_s", "effort_over_s"))
    return Log(effort_late_s=late_s, effort_over_s=over_s)


_WAYS: tuple[_Way, ...] = (
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
