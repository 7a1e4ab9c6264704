"""By how much an effort was written down after it acted.

A log that asks a controller less often than it works holds an effort for as long as a row lasts, and the rig seems to
answer before it is driven: by half a row where rows are regular, by one and more where they are not. How late an effort
is the likelihood says, beside the model that was found.
"""

from __future__ import annotations

from scipy.optimize import minimize_scalar

from fes_pin.data.log import Log
from fes_pin.identify.distributions import chi2_quantile
from fes_pin.identify.fit import Fit
from fes_pin.identify.levels import CERTAIN_LEVEL
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.turns import maximise

LEAST_GAIN = chi2_quantile(1.0 - CERTAIN_LEVEL, 1)
"""Twice the log-likelihood that moving the effort must bring: whatever it stands for, it must be there."""
LEAST_ROWS = 0.25
"""The least: of a log that asks in every second sample of a controller, which holds for half a row."""
MOST_ROWS = 2.0
"""Rows of a log by which an effort may be late: one that it is held when it is written down, and one until the next."""


def lateness_of(fitted: Fit, row_s: float) -> float | None:
    """How late the efforts of a fit's trials are, s; None where they are in time.

    Parameters
    ----------
    fitted
        By the likelihood, of a rig that an effort drives.
    row_s
        Time step of the log.
    """
    doubt = fitted.doubt
    assert doubt is not None
    tried: dict[float, float] = {}

    def cost(late: float) -> float:
        if late not in tried:
            moved = [Log(effort_late_s=late).applied(t) for t in fitted.trials]
            problem = LikelihoodProblem(fitted.model, moved, doubt)
            tried[late] = maximise(problem, fitted.values, fitted.unknowns).sse
        return tried[late]

    if cost(LEAST_ROWS * row_s) > fitted.sse - LEAST_GAIN:
        return None
    most = {"bounds": (0.0, MOST_ROWS * row_s), "method": "bounded", "options": {"xatol": 0.02 * row_s}}
    return float(minimize_scalar(cost, **most).x)


def words_of_lateness(late_s: float) -> str:
    """What is to be said of efforts that were moved."""
    return f"the effort was written down {1e3 * late_s:.2g} ms after it acted, and was moved to when it did"
