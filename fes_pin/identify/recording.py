"""Where readings were low-passed before they were stored, as a laboratory's software does with angles and forces.

A low pass without delay takes from the motion what it takes from the noise, and so much noise that the little of the
motion stands out: of a right model something would be left, and a vibration be named for it. A record that has next to
no noise from sample to sample, beside what the nominal model leaves, may be such a one. Which cut-off it had, if any,
is the one with which the simulation, low-passed as well, is likeliest under the noise that it leaves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize_scalar

from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial, derived_trial
from fes_pin.identify.fit import Fit, fit_multistart, fit_problem, noise_of, rough_noise
from fes_pin.identify.problem import Problem
from fes_pin.infer.levels import SMALL_SHARE, SMOOTH
from fes_pin.models.model import Model

PERIODS, MOST = 10.0, 0.2
"""Cut-offs that are tried: from so many periods in the shortest trial, of which the ends are one or two, to this share
of the sampling rate."""
TRIED = 12
"""Cut-offs, each as many times the one before, between which the best is then sought."""


def low_pass_of(model: Model, trials: Sequence[Trial]) -> float | None:
    """The cut-off of the low pass that readings went through, Hz; None of readings that are as they were read.

    Parameters
    ----------
    model
        The nominal one, with start values.
    trials
        What was measured: freely simulated, not imposed.

    Returns
    -------
    float or None
        Hz, between what ten periods of the shortest trial and a fifth of the sampling rate can tell.

    Raises
    ------
    FloatingPointError
        For residuals that are not finite.
    OutOfTime
        Where a limit of time ends.
    """
    dt, shortest = max(t.dt for t in trials), min(t.duration for t in trials)
    if any(t.kind == IMPOSED for t in trials) or PERIODS / shortest >= MOST / dt:
        return None
    rough = rough_noise(model, trials)
    begun = fit_multistart(Problem(model, trials, rough), model.parameters())
    left = noise_of(begun)
    if any(rough[n].std > SMOOTH * left[n].std for n in left):
        return None

    def fitted(log_hz: float) -> Fit:
        passed = [derived_trial(t, low_pass_hz=float(np.exp(log_hz))) for t in trials]
        return fit_problem(Problem(model, passed, rough), begun.values)

    grid = np.linspace(math.log(PERIODS / shortest), math.log(MOST / dt), TRIED)
    costs = [_cost(fitted(x)) for x in grid]
    best = int(np.argmin(costs))
    if best in (0, TRIED - 1):  # at the end of what can be told
        return None
    near = (grid[best - 1], grid[best + 1])
    found = minimize_scalar(lambda x: _cost(fitted(x)), bounds=near, method="bounded", options={"xatol": 0.01})
    return float(np.exp(found.x)) if improves(fitted(found.x), begun) else None


def improves(passed: Fit, recorded: Fit) -> bool:
    """True if a fit of trials that were low-passed leaves a likelier noise than one of the same trials as recorded.

    By more than little: the power of what is new in each sample must fall by `SMALL_SHARE` of itself. Of readings that
    were low-passed twice the log-likelihood rises by 0.2 to 10 a sample, of others, whose model misses a cause, by 0.07
    at most.
    """
    return _cost(passed) < _cost(recorded) - SMALL_SHARE * sum(map(len, recorded.trials))


def _cost(fitted: Fit) -> float:
    """Twice the negative log-likelihood of a fit's residuals under autoregressive noise of their own."""
    noise, trials = noise_of(fitted), fitted.trials
    counts = {n: sum(one.innovations(len(t), t.dt) for t in trials if n in t) for n, one in noise.items()}
    return float(sum(2.0 * count * math.log(noise[n].innovation_std) for n, count in counts.items()))


__all__ = ["improves", "low_pass_of"]
