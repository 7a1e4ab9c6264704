"""Errors of a model on trials that took no part in its fit: free, over a horizon, and once a trial has begun.

Once a trial has begun, its first samples determine its own parameters, which differ between trials about a common value
(random effects). Of trial i, with J the sensitivities at the common fit and r the residual,

    r_i = J_i d_i + e_i,   d_i ~ N(0, D),   e_i ~ N(0, s^2 c I).

D and s are estimated from the fitted trials by expectation and maximisation; c, how many samples of e weigh as one, is
the one of `WORTH` that predicts the later samples of the fitted trials best from their first ones. Of a new trial d is
estimated from its first samples alone. Laird and Ware, Biometrics 38 (1982).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.identify.ahead import forecast, free_residuals
from fes_pin.identify.fit import Fit, noise_of
from fes_pin.identify.problem import Problem
from fes_pin.infer.held_out import within
from fes_pin.infer.levels import RUNAWAY
from fes_pin.infer.noise import noise_step, thinning
from fes_pin.prepare.measured import folds_of
from fes_pin.workers import in_parallel

WORTH = (1.0, 3.0, 10.0, 30.0, 100.0)
"""Most samples that count as one: errors of a model have a correlation time of some tenths of a second."""
TURNS = 40
"""Steps of expectation and maximisation; the last changes D by less than a hundredth."""
FEWEST = 4
"""Least number of trials from which the differences between trials are estimated."""

Pair = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Parting:
    """Trials that are fitted, and others that this fit predicts."""

    fitted: Sequence[Trial]
    held: Sequence[Trial]


def partings(fitted: Sequence[Trial], held: Sequence[Trial]) -> list[Parting]:
    """Partings that predict each trial once: trials that the study holds out, or else each by a fit without it."""
    every = [*fitted, *held]
    folds = [list(range(len(fitted), len(every)))] if held else folds_of(fitted)
    return [Parting([t for i, t in enumerate(every) if i not in out], [every[i] for i in out]) for out in folds]


def left_out_errors(
    fits: Sequence[Fit], parts: Sequence[Parting], horizon_s: float, given_s: float | None
) -> dict[str, np.ndarray]:
    """Mean squared errors of one model on every held-out trial, in the unit of its column, squared.

    Returns
    -------
    dict of str to ndarray, shape (trials,)
        "free" of predictions from the inputs alone; "horizon" of each sample from what was measured up to the horizon
        before it; "begun" of a trial's remaining samples from its first ones, and "free_rest" of the same samples, not
        where that was not asked for, or trials are too few to estimate how they differ; "around" of the measurement
        about the mean of its trial.
    """
    many = in_parallel(lambda pair: _of_parting(*pair, horizon_s, given_s), list(zip(fits, parts, strict=True)))
    return {n: np.concatenate([m[n] for m in many]) for n in many[0] if all(n in m for m in many)}


def _of_parting(fitted: Fit, part: Parting, horizon_s: float, given_s: float | None) -> dict[str, np.ndarray]:
    noise, rows = noise_of(fitted) if math.isfinite(fitted.sse) else fitted.noise, []
    for trial in part.held:
        name = fitted.model.rig.output(trial.kind)
        left = free_residuals(fitted.model, trial, fitted.noise)[name]
        ahead = left - forecast(np.nan_to_num(left), noise[name], trial.dt, horizon_s)
        rows.append([np.nanmean(left**2), np.nanmean(ahead**2), np.nanvar(trial[name])])
    begun = {} if given_s is None else _begun(fitted, part, given_s)
    return {**dict(zip(("free", "horizon", "around"), np.transpose(rows), strict=True)), **begun}


def _begun(fitted: Fit, part: Parting, given_s: float) -> dict[str, np.ndarray]:
    """Mean squared errors after the first seconds of trials: predicted from those, and from the inputs alone."""

    def counts(trials: Sequence[Trial]) -> list[int]:
        step = noise_step([t.dt for t in trials])
        return [math.ceil(given_s / (thinning(t.dt, step) * t.dt) - 1e-9) for t in trials]

    differs = own_part(pairs_of(fitted, part.fitted), counts(part.fitted))
    if differs is None:
        return {}
    begun, rest = [], []
    for trial, pair, count in zip(part.held, pairs_of(fitted, part.held), counts(part.held), strict=True):
        unit = fitted.noise[fitted.model.rig.output(trial.kind)].std ** 2
        begun.append(unit * float(np.mean(within(differs.left(pair, count), RUNAWAY) ** 2)))
        rest.append(unit * float(np.mean(within(pair[0][count:], RUNAWAY) ** 2)))
    return {"begun": np.array(begun), "free_rest": np.array(rest)}


@dataclass(frozen=True)
class OwnPart:
    """Differences between trials: D in units of `scale`, s^2 c.

    Attributes
    ----------
    covariance
        Shape (parameters, parameters).
    scale
        Shape (parameters,): root mean square of each sensitivity.
    variance
        s^2 c.
    """

    covariance: np.ndarray
    scale: np.ndarray
    variance: float

    def left(self, pair: Pair, begun: int) -> np.ndarray:
        """The residual after its first `begun` samples, less the effect of the d that those estimate: (n - begun,)."""
        r, jacobian = pair[0], pair[1] / self.scale
        first = jacobian[:begun]
        prior = np.linalg.inv(self.covariance + 1e-9 * np.trace(self.covariance) * np.eye(len(self.scale)))
        d = np.linalg.solve(first.T @ first / self.variance + prior, first.T @ r[:begun] / self.variance)
        return (r - jacobian @ d)[begun:]


def pairs_of(fitted: Fit, trials: Sequence[Trial]) -> list[Pair]:
    """Residuals and sensitivities of trials at a fit, at the time step of noise, the channels weighed as in the fit."""
    step = noise_step([t.dt for t in trials])
    problem = Problem(fitted.model, trials, {n: replace(one, step_s=step) for n, one in fitted.noise.items()})
    return [(p.residual, p.jacobian) for p in problem.linearize(fitted.values, problem.start_unknowns())]


def own_part(pairs: Sequence[Pair], begun: Sequence[int]) -> OwnPart | None:
    """The distribution of d that predicts trials best after their first samples; None for fewer than `FEWEST` trials.

    Parameters
    ----------
    begun
        Samples of each trial's beginning.
    """
    usable = [(p, b) for p, b in zip(pairs, begun, strict=True) if len(p[0]) > b]
    if len(usable) < FEWEST:
        return None
    tried = [_estimated([p for p, _ in usable], worth) for worth in WORTH]
    return min(tried, key=lambda one: sum(float(np.mean(one.left(p, b) ** 2)) for p, b in usable))


def _estimated(pairs: Sequence[Pair], worth: float) -> OwnPart:
    sizes = np.array([np.mean(j**2, axis=0) for _, j in pairs])
    scale = np.sqrt(np.maximum(sizes.mean(axis=0), 1e-300))
    scaled = [(r, j / scale) for r, j in pairs]
    width = len(scale)
    mean_square = max(float(np.mean([np.mean(r**2) for r, _ in pairs])), 1e-300)
    covariance, variance = mean_square * np.eye(width), mean_square
    for _ in range(TURNS):
        inverse = np.linalg.inv(covariance + 1e-9 * np.trace(covariance) * np.eye(width))
        total, squares, count = np.zeros((width, width)), 0.0, 0
        for r, j in scaled:
            spread = np.linalg.inv(j.T @ j / (variance * worth) + inverse)
            d = spread @ (j.T @ r) / (variance * worth)
            total += spread + np.outer(d, d)
            squares += float(np.sum((r - j @ d) ** 2))
            count += len(r)
        covariance, variance = total / len(pairs), max(squares / count, 1e-12 * mean_square)
    return OwnPart(covariance, scale, variance * worth)
