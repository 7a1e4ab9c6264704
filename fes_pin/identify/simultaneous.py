"""Efforts that answer the very readings that are foretold from them: what that does to the likelihood.

An effort that is said to have acted before it was written down is one that a controller asked for when it had read what
the effort is now said to have caused. With the readings y and the efforts u of all rows,

    y = A + H u + innovations,   u = B + G y,

readings and efforts have the density of the innovations times |det(1 - H G)|. Where causes come before effects that is
1. Where efforts are moved, H has parts on its diagonal and above, and to first order in those above

    cost = -2 sum_k log |1 - sum_i H_(k-i, k) G_(k, k-i)|,   i = 0, 1

is to be added to twice the negative log-likelihood of the innovations. Without it, what answers a reading to come
enlarges the innovations, and efforts seem less late than they are. With it they seem later: that between its rows a log
holds nothing of what answers the noise of a reading is not in it. What is true lies between.

Source: Koopmans, Rubin and Leipnik, Measuring the equation systems of dynamic economics, in Statistical Inference in
Dynamic Economic Models, Cowles Commission Monograph 10, Wiley, 1950.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fes_pin.data.answered import answer_of
from fes_pin.data.log import EFFORT, Log
from fes_pin.data.trial import Trial, derived_trial
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.models.predictor import are_news

SPACING = 40
"""Rows from one pulse by which H is measured to the next: what is left of the last one is smooth by then."""
PULSE = 1e-3
"""Of an effort's deviation: a pulse so small moves a rig in proportion."""


def cost_of_answers(fitted: LikelihoodFit, logged: Sequence[Trial], log: Log) -> float:
    """What is to be added to a fit's cost because its efforts answer what is foretold from them; 0 of those in time.

    Parameters
    ----------
    fitted
        By the likelihood, to trials whose efforts were moved.
    logged
        The same trials as they were logged.
    log
        How they were.
    """
    if log.effort_late_s <= 0.0 and log.effort_over_s <= 0.0:
        return 0.0
    rows = [_rows(t, fitted.noise.lasts_s) for t in logged]
    sizes = [PULSE * float(np.std(t[EFFORT])) for t in logged]
    pulsed = [_pulsed(t, at, size) for t, at, size in zip(logged, rows, sizes, strict=True)]
    plain, moved = (
        LikelihoodProblem(fitted.model, [log.applied(t) for t in some], fitted.noise).foretold(fitted.values)
        for some in (logged, pulsed)
    )
    total = 0.0
    for trial, at, size, before, after in zip(logged, rows, sizes, plain, moved, strict=True):
        if not len(at) or size == 0.0:
            continue
        gains = answer_of(trial[EFFORT], [trial[n] for n in before]).gains[at]
        loop = sum(_felt((after[n].values - before[n].values) / size, at, gains[:, k]) for k, n in enumerate(before))
        counted = int(np.sum(are_news(trial, fitted.noise.lasts_s)))
        with np.errstate(divide="ignore"):
            total -= 2.0 * counted * float(np.mean(np.log(np.abs(1.0 - loop))))
    return total


def _rows(trial: Trial, lasts_s: float) -> np.ndarray:
    """Where the pulses of a trial are: at readings that count."""
    news = np.flatnonzero(are_news(trial, lasts_s))
    return news[(news >= SPACING) & (np.diff(news // SPACING, prepend=-1) > 0)]


def _pulsed(trial: Trial, at: np.ndarray, size: float) -> Trial:
    effort = np.array(trial[EFFORT], dtype=float)
    effort[at] += size
    return derived_trial(trial, columns={**trial.columns, EFFORT: effort})


def _felt(change: np.ndarray, at: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """What an effort asks for itself, by way of a reading, from the change of what is foretold by its pulses.

    What is left of pulses before goes on as a parabola, from the last three rows that an effort which is held and moved
    leaves alone; a spline moves the efforts before them by some hundredths of the pulse.
    """
    last = [change[at - k] for k in (2, 3, 4)]
    now = change[at] - np.tensordot([6.0, -8.0, 3.0], last, 1)
    earlier = change[at - 1] - np.tensordot([3.0, -3.0, 1.0], last, 1)
    return np.asarray(now * gains[:, 0] + earlier * gains[:, 1])
