"""Predictions of a model one sample ahead, over a horizon, and in free simulation.

One sample ahead nearly any model is accurate where sampling is fast. A free simulation of even the best model diverges
where a rig integrates or falls. Errors over a horizon in between test a model at the time scale of its use.

A Kalman filter estimates the state from what was measured where process noise acts (`StateSpaceNoise`), and noise by
its autoregression (`NoiseModel`) where a rig is simulated freely:

    y_t = free_t + e_t,    e_(t|t-k) = e_1' A^k (e_(t-k), e_(t-k-1), ...)',    A the companion matrix.
"""

import math
from collections.abc import Sequence

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.per_trial import cross_fitted_unknowns, predictions
from fes_pin.infer.held_out import within
from fes_pin.infer.levels import HORIZON_S, RUNAWAY
from fes_pin.infer.noise import Noise, NoiseModel, thin, thinning
from fes_pin.infer.problem import Unknowns
from fes_pin.models.autoregression import weights_ahead
from fes_pin.models.model import Model
from fes_pin.models.predictions import PredictedOutput
from fes_pin.models.predictor import StateSpaceNoise, masked

STRIDE = 0.25
"""Share of the horizon by which the newest sample that a prediction uses may be older than the horizon."""
SEEN_AGAIN = 3
"""Ratio of shown to hidden samples along a run that makes several predictions. A prediction starts from all readings
but those that were hidden for earlier predictions of the same run. A filter with a shorter memory loses nothing."""


def default_horizon(trials: Sequence[Trial]) -> float:
    """Return `HORIZON_S` or a tenth of the shortest trial; the longest trial where every motion is imposed."""
    if all(t.kind == IMPOSED for t in trials):
        return max(t.duration for t in trials)
    return min(HORIZON_S, 0.1 * min(t.duration for t in trials))


def forecast(residual: np.ndarray, noise: Noise, dt: float, ahead_s: float) -> np.ndarray:
    """Return the prediction of a residual by autoregressive noise, shape (n,), from samples `ahead_s` older or more.

    With `ahead_s` zero it is one sample ahead; for noise that is known at a longer step, one such step. Such a step is
    predicted as a whole: its first sample, too, uses no newer sample.
    """
    every = thinning(dt, noise.step_s)
    seen, order = thin(residual, every), len(noise.ar)
    steps = max(1, math.ceil((ahead_s - dt) / (every * dt) - 1e-9) + 1)
    predicted = np.zeros(len(seen))
    if order and len(seen) > steps:
        predicted[steps:] = np.convolve(seen, weights_ahead(noise.ar, steps)[-1])[: len(seen) - steps]
    out = np.repeat(predicted, every)
    return np.pad(out, (0, len(residual) - len(out)), mode="edge") if len(out) else np.zeros(len(residual))


def first_ahead(model: Model, trial: Trial, horizon_s: float | None) -> int:
    """Return the first sample that is predicted from more than the first reading; errors are counted from it on.

    It is 0 of a free simulation (None), where the trial ends before, and where the initial state is known.
    """
    first = sum(reach_of(trial, horizon_s)) if horizon_s is not None and model.rig.unknowns(trial.kind) else 0
    return first if first < len(trial) else 0


def predict_ahead(model: Model, trial: Trial, random: NoiseModel, horizon_s: float) -> dict[str, np.ndarray]:
    """Predict each sample of a trial from readings that are older by `horizon_s` or more.

    Parameters
    ----------
    trial
        A trial with outputs; outputs that it does not have are not predicted.
    random
        Noise of the rig: see `identify.stored.load_random`.
    horizon_s
        The horizon, s.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        By output column that the trial has.

    Raises
    ------
    InputError
        If the trial has no output that the model predicts.
    """
    outputs = [n for n in model.rig.outputs(trial.kind) if n in trial.columns]
    if not outputs:
        expected = " or ".join(model.rig.outputs(trial.kind))
        raise InputError(f"expected a column {expected}: a prediction over a horizon goes on from what was measured")
    if isinstance(random, StateSpaceNoise):
        return over_horizon(model, trial, random, horizon_s)
    free = free_ahead(model, trial, {n: random.get(n, Noise(1.0)) for n in outputs}, horizon_s)
    return {n: one.values for n, one in free.items()}


def free_residuals(
    model: Model, trial: Trial, noise: NoiseModel, known: Unknowns | None = None
) -> dict[str, np.ndarray]:
    """Return measured minus freely simulated, shape (n,), by output column of a trial; NaN where unmeasured.

    The error of a simulation that diverges is limited to `RUNAWAY` times the largest reading.

    Parameters
    ----------
    known
        The unknowns of the trial where it was fitted; by default the simulation starts from the first readings.
    """
    readings = predictions(model, trial, noise, known)
    out = {}
    for k, name in enumerate(model.rig.outputs(trial.kind)):
        if name in trial.columns and name in noise:
            most = RUNAWAY * float(np.nanmax(np.abs(trial[name]), initial=0.0))
            out[name] = np.where(np.isfinite(trial[name]), within(trial[name] - readings[:, k], most), np.nan)
    return out


def free_ahead(
    model: Model, trial: Trial, noise: NoiseModel, horizon_s: float, known: Unknowns | None = None
) -> dict[str, PredictedOutput]:
    """Return a free simulation with the prediction of autoregressive noise over a horizon, by output.

    The parameter `known` is as of `free_residuals`.
    """
    out, steps = {}, max(1, round(horizon_s / trial.dt))
    for name, missed in free_residuals(model, trial, noise, known).items():
        own = noise[name]
        ahead = forecast(np.nan_to_num(missed), own, trial.dt, horizon_s)
        grown = np.append(1.0, weights_ahead(own.ar, steps - 1)[:, 0] if own.ar else np.zeros(steps - 1))
        variance = (own.innovation_std**2) * float(grown @ grown)
        out[name] = PredictedOutput(trial[name] - missed + ahead, np.full(len(trial), variance))
    return out


def one_step(model: Model, trial: Trial, noise: StateSpaceNoise) -> dict[str, np.ndarray]:
    """Return innovations, measured minus predicted one sample ahead, shape (n,), by output column.

    They are 0 where nothing was measured, and at the first sample.
    """
    problem = LikelihoodProblem(model, [trial], noise, ())
    judged = model.rig.follows(trial) & (np.arange(len(trial)) > 0)
    out: dict[str, np.ndarray] = {}
    for rows, own in cross_fitted_unknowns(model, trial, noise):
        (predicted,) = problem.predicted(model.parameters(), [own])
        for n, one in predicted.items():
            missed = np.where(judged & np.isfinite(trial[n]), trial[n] - one.values, 0.0)
            out[n] = np.where(rows, missed, out.get(n, missed))
    return out


def over_horizon(model: Model, trial: Trial, noise: StateSpaceNoise, horizon_s: float) -> dict[str, np.ndarray]:
    """Return the values of `forecasts`, shape (n,), by output column that the trial has."""
    return {n: one.values for n, one in forecasts(model, trial, noise, horizon_s).items()}


def forecasts(model: Model, trial: Trial, noise: StateSpaceNoise, horizon_s: float) -> dict[str, PredictedOutput]:
    """Predict each sample of a trial from readings up to `horizon_s` before it.

    Parameters
    ----------
    horizon_s
        The horizon, s; the newest sample that is used may be older by a quarter of it. Until that time has passed,
        predictions start from the first sample.

    Returns
    -------
    dict of str to PredictedOutput
        By output column that the trial has. The first sample is as measured, since there is none before it.
    """
    ahead, stride = reach_of(trial, horizon_s)
    outputs = tuple(n for n in model.rig.outputs(trial.kind) if n in trial.columns)
    starts = range(0, max(len(trial) - ahead, 1), stride)
    lanes = math.ceil((1 + SEEN_AGAIN) * (ahead + stride) / stride)  # runs, so that each sees enough between two
    batches = [starts[k::lanes] for k in range(min(lanes, len(starts)))]
    shown = [masked(trial, outputs, [range(s + 1, s + ahead + stride) for s in own]) for own in batches]
    problem = LikelihoodProblem(model, shown, noise, (), starts=[trial] * len(shown))
    out = {n: PredictedOutput(np.array(trial[n]), np.zeros(len(trial))) for n in outputs}
    for wanted, unknowns in cross_fitted_unknowns(model, trial, noise):
        run = problem.predicted(model.parameters(), [unknowns] * len(shown))
        for own, predicted in zip(batches, run, strict=True):
            for s in own:
                rows = np.arange(s + ahead if s else 1, min(s + ahead + stride, len(trial)))
                rows = rows[wanted[rows]]
                for n in outputs:
                    for whole, part in zip(out[n], predicted[n], strict=True):
                        whole[rows] = part[rows]
    return out


def reach_of(trial: Trial, horizon_s: float) -> tuple[int, int]:
    """Return the samples of a horizon, and the samples by which the newest one that is used may be older."""
    ahead = max(1, round(horizon_s / trial.dt))
    return ahead, max(1, round(STRIDE * ahead))
