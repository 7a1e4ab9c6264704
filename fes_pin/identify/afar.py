"""Fits of models that are far from the data.

A free simulation of a wrong model departs from the data, and the sum of squares of its errors has many minima. A Kalman
filter with large process noise follows the data: its errors are those of one step, and nearly linear in the parameters,
as those of the equation of motion are. Its fit is a start for the fit of free simulations, which are its limit without
process noise. Source: Abarbanel, Creveling, Farsian and Kostuk, Dynamical state and parameter estimation, SIAM J.
Applied Dynamical Systems 8 (2009), who couple the model to the data.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fes_pin.data.counts import WHOLE as OFF_COUNT
from fes_pin.data.counts import count_of
from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial
from fes_pin.identify.fit import Fit, errors_of
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit, maximise
from fes_pin.identify.problem import limits_of
from fes_pin.identify.process_noise import first_guess
from fes_pin.infer.covariance import least_squares_step
from fes_pin.infer.held_out import percent_of_spread
from fes_pin.infer.levels import CONFIDENCE_95, NOTHING_PERCENT, RUNAWAY, UNFELT
from fes_pin.infer.problem import normal_equations
from fes_pin.infer.text import WHOLE
from fes_pin.models.model import Model
from fes_pin.models.predictor import StateSpaceNoise

FOLLOWING = 30.0
"""Process noise by which a filter follows the data, in units of the smallest: a tenth of what drives the rig."""


def misfit_percent(fitted: Fit) -> float:
    """Return E of a fit's free simulations of its trials from their fitted initial states, percent."""
    trials = fitted.trials
    around = {n: [np.nansum((t[n] - np.nanmean(t[n])) ** 2) for t in trials if n in t] for n in _outputs(fitted)}
    spread = {n: max(float(np.sum(a)), 1e-300) for n, a in around.items()}
    with np.errstate(all="ignore"):
        squares = [float(np.sum(v**2 / spread[n])) for one in errors_of(fitted) for n, v in one.items()]
    most = RUNAWAY**2 * len(spread)
    return percent_of_spread(np.clip(np.nan_to_num(squares, nan=most, posinf=most), 0.0, most), float(len(spread)))


def is_rounding(fitted: Fit) -> bool:
    """Return whether the errors of free simulations are those of arithmetic, or all less than half a count."""
    if misfit_percent(fitted) < WHOLE * UNFELT**2:
        return True
    counts = {n: min(count_of(t[n]) for t in fitted.trials if n in t) for n in _outputs(fitted)}
    if not all(counts.values()):
        return False
    most = {n: (0.5 + OFF_COUNT) * count for n, count in counts.items()}
    return all(bool(np.all(np.abs(v) <= most[n])) for one in errors_of(fitted) for n, v in one.items())


def _outputs(fitted: Fit) -> list[str]:
    rig = fitted.model.rig
    return list(dict.fromkeys(n for t in fitted.trials for n in rig.outputs(t.kind) if n in t))


def following(model: Model, trials: Sequence[Trial]) -> StateSpaceNoise | None:
    """Return noise with which a filter of the model follows the trials; None where none can, or none is needed.

    Process noise must drive the rig. No filter includes a low pass of trials, and an imposed motion is followed anyway.
    Readings in counts have the standard deviation of a uniform error at least, else the filter follows each count.
    """
    guess = first_guess(model, trials)
    if not guess.std or any(t.low_pass_hz or t.kind == IMPOSED for t in trials):
        return None
    counts = {n: max(count_of(t[n]) for t in trials if n in t) for n in guess.white}
    white = {n: max(v, counts[n] / math.sqrt(12.0)) for n, v in guess.white.items()}
    return replace(guess, white=white, std={n: FOLLOWING * v for n, v in guess.std.items()})


def followed(models: Sequence[Model], trials: Sequence[Trial], noise: StateSpaceNoise) -> LikelihoodFit:
    """Return the likeliest fit of a filter that follows the trials, from the values of several models."""
    return min((maximise(LikelihoodProblem(m, trials, noise), rounds=1) for m in models), key=lambda f: f.sse)


def with_beliefs(fitted: LikelihoodFit, believed: Model) -> LikelihoodFit:
    """Return a fit again with the nominal parameters that the data do not identify held at their believed values.

    A parameter is not identified if half its interval is above twice its value and twice its believed value, and the
    interval holds the latter, or if it ended at a bound; and if E is the same without. Its estimate would depend on
    where the fit began. They are held one after another: of two whose ratio is identified, one stays free. A fit that
    diverges is returned as it is.
    """
    if not np.isfinite(normal_equations(fitted.parts).hessian).all():
        return fitted
    known, ended = believed.parameters(), at_a_bound(fitted, believed)
    vague = [n for n in fitted.free if n in known and _is_vague(fitted, n, known[n])]
    held = {n: known[n] for n in {*vague[:1], *ended}}
    if not held:
        return fitted
    rig = replace(fitted.model.rig, fitted=tuple(n for n in fitted.model.rig.fitted_parameters() if n not in held))
    model = Model(rig, fitted.model.effects).with_parameters({**_with_others(fitted, held), **held})
    again = maximise(LikelihoodProblem(model, fitted.trials, fitted.noise), fitted.unknowns)
    if misfit_percent(again) > misfit_percent(fitted) + NOTHING_PERCENT:
        return fitted
    return with_beliefs(again, believed)


def _with_others(fitted: LikelihoodFit, held: Mapping[str, float]) -> dict[str, float]:
    """Return the other parameters, moved along the direction that the data do not identify.

    These minimise the cost, to second order, where some parameters are held.
    """
    hessian, free = normal_equations(fitted.parts).hessian, fitted.free
    out, others = [free.index(n) for n in held], [k for k, n in enumerate(free) if n not in held]
    moved = np.array([v - fitted.values[n] for n, v in held.items()])
    step = least_squares_step(hessian[np.ix_(others, others)], -hessian[np.ix_(others, out)] @ moved)
    limits = limits_of(fitted.model, fitted.trials)
    return {
        free[k]: float(np.clip(fitted.values[free[k]] + d, *limits[free[k]])) for k, d in zip(others, step, strict=True)
    }


def _is_vague(fitted: LikelihoodFit, name: str, known: float) -> bool:
    value, reach = fitted.values[name], fitted.reach(name)
    return reach > CONFIDENCE_95 * max(abs(value), abs(known)) and abs(value - known) < reach


def at_a_bound(fitted: Fit, believed: Model) -> set[str]:
    """Return the nominal parameters of a fit that ended at a bound other than 0."""
    return {n for n in fitted.at_bound if n in believed.parameters() and fitted.values[n] != 0.0}
