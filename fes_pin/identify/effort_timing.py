"""Timing of recorded efforts and readings, which a log resolves no finer than its rows.

A log that samples a controller less often than it works holds an effort for a row, so that the rig seems to respond
before it is driven: by half a row where rows are regular, by one row or more where they are not. A spline through the
rows estimates the effort between them as far as it is smooth. Nor does the log say when within its row an effort that
follows the reading begins to act. It is at most half a row later than the reading; what is later is a lag of the rig.
The likelihood of the model that was found estimates the delay of the efforts.

**Efforts that follow the readings that they predict.** An effort that is moved to an earlier time was computed by the
controller from readings that the moved effort is then said to have caused. With the readings y and the efforts u of all
rows,

    y = A + H u + innovations,   u = B + G y,

readings and efforts have the density of the innovations times |det(1 - H G)|. That determinant is 1 where causes come
before effects. Where efforts are moved, H has parts on its diagonal and above, and to first order in those above

    cost = -2 sum_k log |1 - sum_i H_(k-i, k) G_(k, k-i)|,   i = 0, 1

is added to twice the negative log-likelihood of the innovations. Without it, efforts that follow a later reading
enlarge the innovations, and the delay is estimated as too small. With it, the delay is estimated as too large, since a
log holds nothing of the controller's response to noise between its rows. The truth lies between the two estimates.

**Time of a reading.** A controller applies an effort some time after it reads, while a simulation in steps applies it
at the reading. With d the time by which a reading is early, and v the velocity of the quantity that is read,

    y = h(x) + d v,   |d| <= row / 2, with the prior standard deviation row / sqrt(12).

The data determine d, but an error of form, as of friction by bristles, has a similar effect. Estimates are therefore
those at d = 0, and intervals include the mean square of their change by d, from the data and from the prior.

Source: Koopmans, Rubin and Leipnik, Measuring the equation systems of dynamic economics, in Statistical Inference in
Dynamic Economic Models, Cowles Commission Monograph 10, Wiley, 1950.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from fes_pin.data.answered import answer_of
from fes_pin.data.log import EFFORT, Log
from fes_pin.data.trial import Trial, derived_trial
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit, maximum_from
from fes_pin.infer.covariance import covariance_of, widened
from fes_pin.infer.levels import CERTAIN_GAIN, LEAST_LATE_ROWS, MOST_EARLY_ROWS, MOST_LATE_ROWS
from fes_pin.infer.problem import Linearized, normal_equations, whitened_sse
from fes_pin.infer.scatter import at_rest, scores_of, with_honest_intervals
from fes_pin.models.parameters import parameter
from fes_pin.models.predictor import are_news
from fes_pin.models.stage import Effect, Stage
from fes_pin.workers import in_parallel

SPACING = 40
"""Rows between the pulses with which H is measured: by then the response to the last pulse is smooth."""
PULSE = 1e-3
"""Size of a pulse, in standard deviations of the effort: the response of a rig is linear in so small a pulse."""
STEP = 0.05
"""Step of the difference that gives the slope of the cost, as a share of a row: readings are smooth over a row."""

_Way = tuple[Callable[[float], Log], float]


@dataclass(frozen=True)
class Lateness:
    """The delay of a log's efforts, and the cost of trials with efforts at the estimated times.

    Attributes
    ----------
    log
        The log with the mean of two estimates: by the innovations alone, which is too small, and by these together with
        the feedback of efforts, which is too large.
    at_most
        The log with the larger estimate.
    gain
        What the delay adds to twice the log-likelihood of the same model.
    """

    log: Log
    cost: float
    at_most: Log
    gain: float

    @property
    def is_certain(self) -> bool:
        """Whether the gain is significant."""
        return self.gain > CERTAIN_GAIN


def lateness_of(fitted: LikelihoodFit, row_s: float, as_logged: bool = False) -> Lateness:
    """Return the delay with which the efforts of a fit's trials were recorded; the least delay where none is certain.

    Parameters
    ----------
    fitted
        A fit of a rig that an effort drives.
    row_s
        Time step of the log, s.
    as_logged
        Whether rows are as logged and not averaged: efforts may then also act later than recorded, or between rows.
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
    begun = in_parallel(lambda way: moved(way[0](LEAST_LATE_ROWS * row_s)).sse, ways)
    if min(begun) > fitted.sse - CERTAIN_GAIN:
        least = ways[int(np.argmin(begun))][0](LEAST_LATE_ROWS * row_s)
        return Lateness(least, min(begun), least, fitted.sse - min(begun))
    worth = [way for way, sse in zip(ways, begun, strict=True) if sse < fitted.sse]
    found = {lowest(way, lambda log: moved(log).sse): way for way in worth}
    best = min(found, key=lambda log: moved(log).sse)
    answering = lowest(found[best], lambda log: moved(log).sse + cost_of_answers(moved(log), fitted.trials, log))
    late_s, over_s = (0.5 * (getattr(best, n) + getattr(answering, n)) for n in ("effort_late_s", "effort_over_s"))
    between = Log(effort_late_s=late_s, effort_over_s=over_s)
    return Lateness(between, moved(between).sse, answering, fitted.sse - moved(best).sse)


_WAYS: tuple[_Way, ...] = (
    (lambda late_s: Log(effort_late_s=late_s), MOST_LATE_ROWS),
    (lambda early_s: Log(effort_late_s=-early_s), MOST_EARLY_ROWS),
    (lambda late_s: Log(effort_over_s=2.0 * late_s), MOST_EARLY_ROWS),
)
"""Ways in which efforts can be recorded late, each with its limit in rows: half a row for a fast controller."""


def words_of_lateness(log: Log) -> str:
    """Return a warning about efforts that were moved, or interpolated between rows."""
    if log.effort_over_s:
        often = "the effort was recorded less often than the controller acted, and was interpolated between rows"
        return f"{often}, over {1e3 * log.effort_over_s:.2g} ms from each"
    late_s = log.effort_late_s
    when = "after" if late_s > 0.0 else "before"
    return f"the effort was recorded {1e3 * abs(late_s):.2g} ms {when} it acted, and was moved to that time"


def cost_of_answers(fitted: LikelihoodFit, logged: Sequence[Trial], log: Log) -> float:
    """Return the part of a fit's cost that is due to efforts which follow the readings that they predict.

    It is 0 for efforts that were not moved.

    Parameters
    ----------
    fitted
        A fit to trials whose efforts were moved.
    logged
        The same trials as logged.
    log
        The timing that was applied to them.
    """
    if log.effort_late_s <= 0.0 and log.effort_over_s <= 0.0:
        return 0.0
    correlation_s = fitted.noise.correlation_s
    rows = [_pulse_rows(t, correlation_s) for t in logged]
    sizes = [PULSE * float(np.std(t[EFFORT])) for t in logged]
    pulsed = [_pulsed(t, at, size) for t, at, size in zip(logged, rows, sizes, strict=True)]
    plain, moved = (
        LikelihoodProblem(fitted.model, [log.applied(t) for t in some], fitted.noise).predicted(fitted.values)
        for some in (logged, pulsed)
    )
    total = 0.0
    for trial, at, size, before, after in zip(logged, rows, sizes, plain, moved, strict=True):
        if not len(at) or size == 0.0:
            continue
        gains = answer_of(trial[EFFORT], [trial[n] for n in before]).gains[at]
        loop = sum(_loop((after[n].values - before[n].values) / size, at, gains[:, k]) for k, n in enumerate(before))
        counted = int(np.sum(are_news(trial, correlation_s)))
        with np.errstate(divide="ignore"):
            total -= 2.0 * counted * float(np.mean(np.log(np.abs(1.0 - loop))))
    return total


def _pulse_rows(trial: Trial, correlation_s: float) -> np.ndarray:
    """Return the rows of the pulses of a trial: at readings that enter the likelihood."""
    news = np.flatnonzero(are_news(trial, correlation_s))
    return news[(news >= SPACING) & (np.diff(news // SPACING, prepend=-1) > 0)]


def _pulsed(trial: Trial, at: np.ndarray, size: float) -> Trial:
    effort = np.array(trial[EFFORT], dtype=float)
    effort[at] += size
    return derived_trial(trial, columns={**trial.columns, EFFORT: effort})


def _loop(change: np.ndarray, at: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """Return the loop gain of an effort, through the reading to itself, from the change of predictions by its pulses.

    The response to earlier pulses is extrapolated by a parabola through the last three rows that a held and moved
    effort does not change; a spline changes the efforts before them by some hundredths of the pulse.
    """
    last = [change[at - k] for k in (2, 3, 4)]
    now = change[at] - np.tensordot([6.0, -8.0, 3.0], last, 1)
    earlier = change[at - 1] - np.tensordot([3.0, -3.0, 1.0], last, 1)
    return np.asarray(now * gains[:, 0] + earlier * gains[:, 1])


@dataclass(frozen=True)
class EarlyReading(Effect):
    """A reading that is early. It is in no library, as it is never reported."""

    early_s: float = parameter(0.0, unit="s", null=0.0)

    name, stage, signal, rigs = "early_reading", Stage.SENSOR, "reading", ("joint",)

    def apply(self, value: Any, s: Any) -> Any:
        return value + self.early_s * s.x.v


EARLY = "early_reading.early_s"


def with_timing_of_readings(fitted: LikelihoodFit, row_s: float) -> LikelihoodFit:
    """Return a fit of a driven joint with intervals that allow for any time of a reading within its row.

    Parts of the intervals beyond the sandwich estimator are kept. The fit is returned unchanged where no output is a
    position with a velocity `v`, as in a rig of one's own, or where an earlier reading cannot be predicted.

    Parameters
    ----------
    row_s
        Time from one row of the log to the next.
    """
    rig = fitted.model.rig
    if not (rig.takes(EarlyReading) and all("v" in rig.states(t.kind) for t in fitted.trials)):
        return fitted
    before, now, after = (_linearized(fitted, early_s) for early_s in (-STEP * row_s, 0.0, STEP * row_s))
    slope = 0.5 * (whitened_sse(after) - whitened_sse(before)) / (2.0 * STEP * row_s)  # of half the cost
    if not math.isfinite(slope):
        return fitted
    parts, free = at_rest(now), np.array([*(n not in fitted.at_bound for n in fitted.free), True])
    hessian = normal_equations(parts).hessian
    hessian[-1, -1] += 12.0 / row_s**2
    known = covariance_of(hessian, free)
    moved = known[:, -1] * min(abs(slope), 0.5 * row_s / known[-1, -1])
    wide = (widened(known, scores_of(parts)) + np.outer(moved, moved))[:-1, :-1]
    return replace(fitted, covariance=wide + _beyond_scatter(fitted))


def _beyond_scatter(fitted: LikelihoodFit) -> np.ndarray:
    """Return the excess of a fit's covariance over the sandwich estimator, shape (free, free); 0 of parameters without
    one."""
    with np.errstate(invalid="ignore"):  # parameters that are not identifiable
        more = fitted.covariance - with_honest_intervals(fitted).covariance
    kept = np.nan_to_num(np.diag(more)) > 0.0
    return np.where(np.isfinite(more) & np.outer(kept, kept), more, 0.0)


def _linearized(fitted: LikelihoodFit, early_s: float) -> Sequence[Linearized]:
    """Return the trials of a fit with early readings, and sensitivities to that time after those of the fit."""
    free = (*fitted.free, EARLY)
    problem = LikelihoodProblem(fitted.model + EarlyReading(), fitted.trials, fitted.noise, free)
    return problem.linearize({**fitted.values, EARLY: early_s}, fitted.unknowns)


def with_lateness(fitted: LikelihoodFit, at_most: LikelihoodFit) -> LikelihoodFit:
    """Return a fit with intervals that allow for efforts as late as in another fit, and as much earlier.

    The delay is taken as uniform between: the mean square of an estimate's error is a third of the largest.

    Parameters
    ----------
    at_most
        The same model, with efforts as late as they can be.
    """
    apart = np.array([at_most.values[n] - fitted.values[n] for n in fitted.free])
    return replace(fitted, covariance=fitted.covariance + np.outer(apart, apart) / 3.0)
