"""Errors of a model on trials that took no part in its fit: free, over a horizon, and once a trial has begun."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fes_pin.comparison.own_part import own_part, pairs_of, stride
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.held_out import folds_of
from fes_pin.identify.ahead import forecast, own_noise
from fes_pin.identify.fit import Fit, fit_multistart
from fes_pin.identify.per_trial import predictions
from fes_pin.identify.problem import Problem
from fes_pin.infer.held_out import within
from fes_pin.infer.levels import RUNAWAY
from fes_pin.infer.noise import Noise
from fes_pin.models.model import Model
from fes_pin.workers import in_parallel


@dataclass(frozen=True)
class Parting:
    """Trials that are fitted, and others that this fit predicts."""

    fitted: tuple[Trial, ...]
    held: tuple[Trial, ...]


@dataclass(frozen=True)
class LeftOutErrors:
    """Mean squared errors of one model, one number a held-out trial, in the unit of its column, squared.

    Attributes
    ----------
    free, horizon, begun
        Shape (trials,): of predictions from the inputs alone; of each sample from what was measured up to the horizon
        before it; of a trial's remaining samples from its first ones (None if that was not asked for, or trials are too
        few to estimate how they differ).
    free_rest
        As `free`, of the same samples as `begun`.
    around
        Shape (trials,): mean squares of the measurement about the mean of its trial.
    """

    free: np.ndarray
    horizon: np.ndarray
    begun: np.ndarray | None
    free_rest: np.ndarray | None
    around: np.ndarray


def partings(fitted: Sequence[Trial], held: Sequence[Trial]) -> tuple[Parting, ...]:
    """Partings that predict each trial once: trials that the study holds out, or else each by a fit without it."""
    if held:
        return (Parting(tuple(fitted), tuple(held)),)
    folds = folds_of(fitted)
    return tuple(
        Parting(tuple(t for i, t in enumerate(fitted) if i not in fold), tuple(fitted[i] for i in fold))
        for fold in folds
    )


def spreads(model: Model, trials: Sequence[Trial]) -> dict[str, float]:
    """Standard deviation of each measured column about the mean of all trials, by name: what weighs the columns."""
    columns: dict[str, list[np.ndarray]] = {}
    for trial in trials:
        columns.setdefault(model.rig.output(trial.kind), []).append(trial[model.rig.output(trial.kind)])
    return {n: max(float(np.nanstd(np.concatenate(v))), 1e-12) for n, v in columns.items()}


def fits_of(model: Model, parts: Sequence[Parting], scale: Mapping[str, float]) -> list[Fit]:
    """Fits for least free error, one for each parting."""
    white = {n: Noise(s, (), s) for n, s in scale.items()}
    return in_parallel(lambda p: fit_multistart(Problem(model, p.fitted, white), model.parameters()), parts)


def left_out_errors(
    fits: Sequence[Fit], parts: Sequence[Parting], scale: Mapping[str, float], horizon_s: float, given_s: float | None
) -> LeftOutErrors:
    """Errors of one model on every held-out trial, parting after parting."""
    many = in_parallel(lambda pair: _of_parting(*pair, scale, horizon_s, given_s), list(zip(fits, parts, strict=True)))
    free, horizon = (np.concatenate([m[k] for m in many]) for k in (0, 1))
    rig = fits[0].model.rig
    around = np.array([float(np.var(t[rig.output(t.kind)])) for p in parts for t in p.held])
    if given_s is None or any(m[2] is None for m in many):
        return LeftOutErrors(free, horizon, None, None, around)
    begun, rest = (np.concatenate([m[k] for m in many]) for k in (2, 3))
    return LeftOutErrors(free, horizon, begun, rest, around)


def _of_parting(
    fitted: Fit, part: Parting, scale: Mapping[str, float], horizon_s: float, given_s: float | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, np.ndarray | None]:
    noise = own_noise(fitted)
    rig = fitted.model.rig
    free, ahead = [], []
    for trial, readings in zip(part.held, predictions(fitted.model, part.held, fitted.noise), strict=True):
        name = rig.output(trial.kind)
        most = RUNAWAY * scale[name]
        left = within(trial[name] - readings[:, 0], most)
        free.append(float(np.mean(left**2)))
        predicted = forecast(left, noise[name], trial.dt, horizon_s)
        ahead.append(float(np.mean(within(left - predicted, most) ** 2)))
    begun, rest = (None, None) if given_s is None else _begun(fitted, part, scale, given_s)
    return np.array(free), np.array(ahead), begun, rest


def _begun(
    fitted: Fit, part: Parting, scale: Mapping[str, float], given_s: float
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Mean squared errors after the first seconds of trials: predicted from those, and from the inputs alone."""

    def counts(trials: Sequence[Trial]) -> list[int]:
        return [math.ceil(given_s / (stride(t) * t.dt) - 1e-9) for t in trials]

    differs = own_part(pairs_of(fitted, part.fitted), counts(part.fitted))
    if differs is None:
        return None, None
    begun, rest = [], []
    for trial, pair, count in zip(part.held, pairs_of(fitted, part.held), counts(part.held), strict=True):
        unit = scale[fitted.model.rig.output(trial.kind)] ** 2
        begun.append(unit * float(np.mean(within(differs.left(pair, count), RUNAWAY) ** 2)))
        rest.append(unit * float(np.mean(within(pair[0][count:], RUNAWAY) ** 2)))
    return np.array(begun), np.array(rest)
