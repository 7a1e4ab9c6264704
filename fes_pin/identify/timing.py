"""When within its row a reading was taken, and an effort began to act: what no log says, and intervals must hold.

A controller reads, and asks for an effort some time later; a simulation in steps lets it act before. With d the time
by which a reading is early, and v the velocity of what is read,

    y = h(x) + d v,   |d| <= row / 2, of deviation row / sqrt(12) before anything is measured.

The data tell d, but an error of form, as of friction by bristles, looks like one. So estimates stay where d is 0, and
intervals hold the mean square of what d moves them by, as the data have it beside what was known before.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.covariance import covariance_of, widened
from fes_pin.infer.problem import Linearized, normal_equations, whitened_sse
from fes_pin.infer.scatter import at_rest, scores_of, with_honest_intervals
from fes_pin.models.parameters import parameter
from fes_pin.models.stage import Effect, Stage

STEP = 0.05
"""Of a row: half the difference that the slope of the cost is. Readings are smooth over a row."""


@dataclass(frozen=True)
class EarlyReading(Effect):
    """A reading that is early: of no library, as nobody is to be told."""

    early_s: float = parameter(0.0, unit="s", null=0.0)

    name, stage, signal, rigs = "early_reading", Stage.SENSOR, "reading", ("joint",)

    def apply(self, value: Any, s: Any) -> Any:
        return value + self.early_s * s.x.v


EARLY = "early_reading.early_s"


def with_doubt_of_timing(fitted: LikelihoodFit, row_s: float) -> LikelihoodFit:
    """A fit by the likelihood, of a joint that an effort drives, with intervals that hold when a reading was taken.

    What those of the fit hold beyond how its scores scatter they go on to hold.

    As it is where nothing that is read is a place with a velocity `v`, as of a rig of one's own, or where a reading
    that is a little earlier cannot be foretold.

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
    """What the covariance of a fit has more than how its scores scatter, shape (free, free); 0 of parameters that have
    less."""
    with np.errstate(invalid="ignore"):  # what the data do not tell
        more = fitted.covariance - with_honest_intervals(fitted).covariance
    kept = np.nan_to_num(np.diag(more)) > 0.0
    return np.where(np.isfinite(more) & np.outer(kept, kept), more, 0.0)


def _linearized(fitted: LikelihoodFit, early_s: float) -> Sequence[Linearized]:
    """The trials of a fit, with readings that are so early, and sensitivities to that behind those of the fit."""
    free = (*fitted.free, EARLY)
    problem = LikelihoodProblem(fitted.model + EarlyReading(), fitted.trials, fitted.noise, free)
    return problem.linearize({**fitted.values, EARLY: early_s}, fitted.unknowns)


def with_doubt_of_lateness(fitted: LikelihoodFit, at_most: LikelihoodFit) -> LikelihoodFit:
    """A fit with intervals that hold by how much its efforts may be later or earlier: up to what another fit has.

    Anything between has the same chance, and the mean square of what an estimate is off by is a third of the most.

    Parameters
    ----------
    at_most
        The same model, with efforts as late as they can be.
    """
    apart = np.array([at_most.values[n] - fitted.values[n] for n in fitted.free])
    return replace(fitted, covariance=fitted.covariance + np.outer(apart, apart) / 3.0)
