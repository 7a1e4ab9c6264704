"""Errors of a model on trials that took no part in its fit: free, over a horizon, and once a trial has begun."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fes_pin.comparison.own_part import own_part, pairs_of
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.held_out import folds_of
from fes_pin.identify.ahead import forecast, free_residuals
from fes_pin.identify.fit import Fit, fit_multistart, noise_of
from fes_pin.identify.problem import Problem
from fes_pin.infer.held_out import within
from fes_pin.infer.levels import RUNAWAY
from fes_pin.infer.noise import Noise, noise_step, thinning
from fes_pin.models.model import Model
from fes_pin.workers import in_parallel


@dataclass(frozen=True)
class Parting:
    """Trials that are fitted, and others that this fit predicts."""

    fitted: tuple[Trial, ...]
    held: tuple[Trial, ...]


def partings(fitted: Sequence[Trial], held: Sequence[Trial]) -> tuple[Parting, ...]:
    """Partings that predict each trial once: trials that the study holds out, or else each by a fit without it."""
    if held:
        return (Parting(tuple(fitted), tuple(held)),)
    folds = folds_of(fitted)
    return tuple(
        Parting(tuple(t for i, t in enumerate(fitted) if i not in fold), tuple(fitted[i] for i in fold))
        for fold in folds
    )


def spread_noise(model: Model, trials: Sequence[Trial]) -> dict[str, Noise]:
    """White noise as large as each measured column varies about the mean of all trials: what weighs the columns."""
    columns: dict[str, list[np.ndarray]] = {}
    for trial in trials:
        columns.setdefault(model.rig.output(trial.kind), []).append(trial[model.rig.output(trial.kind)])
    stds = {n: max(float(np.nanstd(np.concatenate(v))), 1e-12) for n, v in columns.items()}
    return {n: Noise(std, (), std) for n, std in stds.items()}


def fits_of(model: Model, parts: Sequence[Parting], white: Mapping[str, Noise]) -> list[Fit]:
    """Fits for least free error, one for each parting."""
    return in_parallel(lambda p: fit_multistart(Problem(model, p.fitted, white)), parts)


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
