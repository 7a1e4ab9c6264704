"""Estimate of a low pass that readings went through before they were stored, as in laboratory software.

A low pass without delay removes the fast part of motion and noise. With so little noise that part of the motion is
significant: a right model would have a lack of fit, and a vibration might be named for it. A record with little noise
from sample to sample, compared with the residuals of the nominal model, may be low-passed. The cut-off is the one at
which the simulation, low-passed as well, is likeliest under the noise of its residuals.
"""

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize_scalar

from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial, derived_trial
from fes_pin.identify.fit import Fit, fit_problem, noise_of, rough_fit
from fes_pin.identify.problem import Problem
from fes_pin.infer.levels import SMALL_SHARE, SMOOTH
from fes_pin.infer.noise import thinning
from fes_pin.models.model import Model

PERIODS, MOST = 10.0, 0.2
"""Range of cut-offs that are tried: from so many periods in the shortest trial, of which its ends spoil one or two, to
this share of the sampling rate."""
TRIED = 12
"""Cut-offs on a logarithmic grid, between which the best is then sought."""


def low_pass_of(model: Model, trials: Sequence[Trial]) -> tuple[float, float] | None:
    """Estimate the low pass that readings went through; None of readings without one.

    The power of the innovations must fall by `SMALL_SHARE`. For readings that were low-passed twice the log-likelihood
    rises by 0.2 to 10 a sample; for others whose model misses a cause, by 0.07 at most.

    Parameters
    ----------
    model
        The nominal model, with start values.
    trials
        Measured trials: freely simulated, not imposed.

    Returns
    -------
    tuple or None
        The cut-off in Hz, between ten periods in the shortest trial and a fifth of the sampling rate, and the gain in
        twice the log-likelihood.

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
    begun = rough_fit(model, trials)
    if any(begun.noise[n].std > SMOOTH * left.std for n, left in noise_of(begun).items()):
        return None

    def cost(log_hz: float) -> float:
        passed = [derived_trial(t, low_pass_hz=float(np.exp(log_hz))) for t in trials]
        return _cost(fit_problem(Problem(model, passed, begun.noise), begun.values))

    grid = np.linspace(math.log(PERIODS / shortest), math.log(MOST / dt), TRIED)
    costs = [cost(x) for x in grid]
    best = int(np.argmin(costs))
    if best in (0, TRIED - 1):  # at an end of the range
        return None
    near = (grid[best - 1], grid[best + 1])
    found = minimize_scalar(cost, bounds=near, method="bounded", options={"xatol": 0.01})
    gain = _cost(begun) - float(found.fun)
    return (float(np.exp(found.x)), gain) if gain > SMALL_SHARE * sum(map(len, trials)) else None


def words_of_low_pass(hz: float, names: Sequence[str]) -> str:
    """Return a warning about readings that were low-passed."""
    which = " and ".join(dict.fromkeys(names))
    return f"{which} seems low-passed at {hz:.2g} Hz: the simulation was low-passed there as well"


def _cost(fitted: Fit) -> float:
    """Return twice the negative log-likelihood of a fit's residuals under their autoregressive noise."""
    noise, trials = noise_of(fitted), fitted.trials
    counts = {n: sum(len(t) // thinning(t.dt, one.step_s) for t in trials if n in t) for n, one in noise.items()}
    return float(sum(2.0 * count * math.log(noise[n].innovation_std) for n, count in counts.items()))
