"""By how much an effort was written down after it acted, or before.

A log that asks a controller less often than it works holds an effort for as long as a row lasts, and the rig seems to
answer before it is driven: by half a row where rows are regular, by one and more where they are not. When within its
row an effort that answers the reading begins to act no log says; it is at most half a row later than the reading, for
what is later is a lag. How late an effort is the likelihood says, beside the model that was found.
"""

from __future__ import annotations

from dataclasses import dataclass

from scipy.optimize import minimize_scalar

from fes_pin.data.log import Log
from fes_pin.data.trial import Trial
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
    """How late efforts are, s, negative where they act after they are written; and the cost of trials so moved."""

    late_s: float
    cost: float


def lateness_of(fitted: Fit, row_s: float, or_early: bool = False) -> Lateness | None:
    """How late the efforts of a fit's trials are; None where they are in time.

    Parameters
    ----------
    fitted
        By the likelihood, of a rig that an effort drives.
    row_s
        Time step of the log.
    or_early
        Whether they may act later than written as well: asked of rows as they were logged, not of their averages.
    """
    tried: dict[float, float] = {}

    def cost(late: float) -> float:
        if late not in tried:
            tried[late] = maximum_from(fitted, _moved(fitted, late)).sse
        return tried[late]

    least = (LEAST_ROWS * row_s, -LEAST_ROWS * row_s)[: 1 + or_early]
    lowest, first = min(zip(in_parallel(cost, least), least, strict=True))
    if lowest > fitted.sse - CERTAIN_GAIN:
        return None
    bounds = (0.0, MOST_ROWS * row_s) if first > 0.0 else (-MOST_EARLY_ROWS * row_s, 0.0)
    found = minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 0.02 * row_s})
    return Lateness(float(found.x), float(found.fun))


def _moved(fitted: Fit, late_s: float) -> list[Trial]:
    """The trials of a fit with efforts that were written down so late where they acted."""
    return [Log(effort_late_s=late_s).applied(t) for t in fitted.trials]


def words_of_lateness(late_s: float) -> str:
    """What is to be said of efforts that were moved."""
    when = "after" if late_s > 0.0 else "before"
    return f"the effort was written down {1e3 * abs(late_s):.2g} ms {when} it acted, and was moved to when it did"
