"""What is left beside a model in which the rig is driven at random: efforts and readings that follow its own state.

The innovations of the predictor are white where the model is right. Some forty functions of state, input and time, each
as an effort at the joint (or a force), and some as a part of the reading, are scored against them beside everything
that was fitted. The random effort that was found is part of the model: what is left must stand out of it.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np

from fes_pin.diagnose.remainder.open_set import SIGN_DRAWS, Remainder
from fes_pin.diagnose.search.likelihood_search import CLAIM_LEVEL
from fes_pin.diagnose.search.score import Projection
from fes_pin.identify.distributions import chi2_tail
from fes_pin.identify.fit import Fit
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.models.features import EffortFeatures, ForceFeatures, ReadingFeatures
from fes_pin.models.stage import Effect

KEPT = 1e-3
"""Share of a feature's norm that what was fitted must leave for it to be judged."""


def driven_remainder(fitted: Fit, seed: int = 0) -> Remainder:
    """Test whether any feature stands out of what a fit leaves.

    A remainder is claimed at the level that a cause is: a filter's slopes are an approximation, and what they miss of a
    friction that was found stood out at 0.01 and 0.02. Half of it goes to the largest single feature, half to all
    together. The chi-square is divided by its inflation under random signs of the trials, where there are enough.
    """
    names, columns = _whitened(fitted)
    projection = Projection(fitted.parts)
    left = projection(columns)
    before, after = np.linalg.norm(columns, axis=0), np.linalg.norm(left, axis=0)
    good = after > KEPT * np.where(before > 0, before, 1.0)
    if not good.any():
        return Remainder(False, 1.0, None)
    names, left = [names[k] for k in np.flatnonzero(good)], left[:, good] / after[good]
    by_trial = _by_trial(left, projection.residual, fitted)
    values, vectors = np.linalg.eigh(left.T @ left)
    kept = values > 1e-4 * values.max()
    shares = by_trial @ vectors[:, kept] / np.sqrt(values[kept])
    rank, statistic = int(kept.sum()), float(np.sum(shares.sum(axis=0) ** 2))
    inflation = _inflation(shares, rank, seed)
    single = by_trial.sum(axis=0) ** 2
    best = int(np.argmax(single))
    largest = rank * float(chi2_tail(float(single[best]) / inflation, 1))
    p_value = min(1.0, 2.0 * min(float(chi2_tail(statistic / inflation, rank)), largest))
    unexplained = p_value < CLAIM_LEVEL
    return Remainder(unexplained, p_value, names[best].split(":")[0] if unexplained else None)


def _whitened(fitted: Fit) -> tuple[list[str], np.ndarray]:
    """Names of the features, and the innovations' sensitivities to them in their deviations, all trials end to end."""
    assert fitted.doubt is not None
    signals = {s for t in fitted.trials for s in fitted.model.rig.signals(t.kind)}
    kinds = [EffortFeatures if "torque" in signals else ForceFeatures]
    kinds += [ReadingFeatures] if "reading" in signals else []
    model = fitted.model
    for kind in kinds:
        model = model + _scaled(kind(), fitted)
    names = [n for kind in kinds for n in kind.functions]
    free = tuple(f"{kind.name}.a{k:02d}" for kind in kinds for k in range(len(kind.functions)))
    problem = LikelihoodProblem(model, fitted.trials, fitted.doubt, free)
    run = problem.innovations(model.parameters(), fitted.unknowns)
    columns = [-i.sensitivities[i.seen][:, : len(free)] / np.sqrt(i.variances[i.seen])[:, None] for i in run]
    return names, np.nan_to_num(np.concatenate(columns))


def _scaled(effect: Effect, fitted: Fit) -> Effect:
    """Features whose variables run from about -1 to 1 in these trials."""
    rig, trials = fitted.model.rig, fitted.trials
    moved = [t[(*rig.schema.motion(t.kind), rig.output(t.kind))[0]] for t in trials]
    low, high = float(np.nanmin(np.concatenate(moved))), float(np.nanmax(np.concatenate(moved)))
    lag = [min(max(1, round(0.05 / t.dt)), len(t) - 1) for t in trials]
    rates = [np.abs(q[k:] - q[:-k]) / (k * t.dt) for q, t, k in zip(moved, trials, lag, strict=True)]
    drives = [np.abs(t[n]) for t in trials for n in rig.input_columns(t)]
    scales: dict[str, Any] = {
        "centre": 0.5 * (low + high),
        "reach": max(0.5 * (high - low), 1e-9),
        "speed": max(float(np.nanmax(np.concatenate(rates))), 1e-9),
        "drive": max((float(np.nanmax(d)) for d in drives), default=0.0) or 1.0,
        "duration": max(t.duration for t in trials),
    }
    return replace(effect, **scales)


def _by_trial(columns: np.ndarray, residual: np.ndarray, fitted: Fit) -> np.ndarray:
    """Each trial's part of the inner products of columns and residual, shape (trials, columns)."""
    ends = np.cumsum([0, *(len(p.residual) for p in fitted.parts)])
    return np.array([columns[a:b].T @ residual[a:b] for a, b in itertools.pairwise(ends)])


def _inflation(shares: np.ndarray, rank: int, seed: int) -> float:
    """How much larger than its rank the statistic is with random signs of the trials; 1 with fewer than 4 trials."""
    if len(shares) < 4 or not rank:
        return 1.0
    signs = np.random.default_rng(seed).choice((-1.0, 1.0), size=(SIGN_DRAWS, len(shares)))
    return max(1.0, float(np.mean(np.sum((signs @ shares) ** 2, axis=1))) / rank)
