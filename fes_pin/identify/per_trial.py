"""What is each trial's own: predictions and sizes of effects whose amplitudes have a value of their own in every trial.

Nothing is known of such an amplitude before its trial is measured. A prediction from inputs alone leaves the effect
out. Where there is a measurement, the trial is cut into `SEGMENTS` pieces; the amplitudes that predict the odd pieces
are estimated from the even ones and the other way round, so that no sample takes part in its own prediction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from fes_pin.data.trial import Trial, derived_trial
from fes_pin.identify.fit import Fit
from fes_pin.identify.likelihood import LikelihoodProblem, unknown_names
from fes_pin.identify.process_noise import spread_of_start
from fes_pin.infer.noise import NoiseModel
from fes_pin.infer.problem import Linearized, normal_equations
from fes_pin.models.least_squares import least_squares
from fes_pin.models.model import Model
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.models.simulate import Simulator
from fes_pin.models.stage import Effect

SEGMENTS = 4
"""Pieces of a trial: two would ask a slow oscillation to be foretold over half a trial, many would be as slow noise."""
STEPS = 3
"""Gauss-Newton steps: the amplitudes are linear but for what the joint's own nonlinearity makes of them."""


def predictions(model: Model, trials: Sequence[Trial], noise: NoiseModel) -> list[np.ndarray]:
    """Readings that a model predicts of measured trials, shape (n, outputs) each; see the module.

    Parameters
    ----------
    noise
        By output column: what weighs the channels.
    """
    simulator, values = Simulator(model, trials), model.parameters()
    start = simulator.start(values)
    if not model.own_unknowns():
        return [s.readings for s in simulator.run(values, start)]
    outputs = {n for t in trials for n in model.rig.outputs(t.kind)}
    white = StateSpaceNoise({n: max(noise[n].std, 1e-12) if n in noise else math.inf for n in outputs})
    each = [cross_fitted_unknowns(model, t, white, s) for t, s in zip(trials, start, strict=True)]
    own = [[{**s, **one[k][1]} for s, one in zip(start, each, strict=True)] for k in (0, 1)]
    runs = [simulator.run(values, unknowns) for unknowns in own]
    return [np.where(one[0][0][:, None], a.readings, b.readings) for one, a, b in zip(each, *runs, strict=True)]


def halves(count: int) -> tuple[np.ndarray, np.ndarray]:
    """The odd pieces of a trial and the even ones, as masks of shape (n,)."""
    first = (np.arange(count) * SEGMENTS // count) % 2 == 0
    return first, ~first


def cross_fitted_unknowns(
    model: Model, trial: Trial, noise: StateSpaceNoise, start: Mapping[str, float] | None = None
) -> list[tuple[np.ndarray, dict[str, float]]]:
    """What effects have of a trial's own by the likelihood, and the samples, shape (n,), that it is to foretell.

    Of an effect without such amplitudes that is all of the trial. Where the rig is simulated the initial state is
    estimated beside them, no farther from the start than `spread_of_start` has it: what is seen may have forgotten it.
    Sinusoids are estimated as well by white noise as by the right one (Grenander 1954).

    Parameters
    ----------
    start
        Where the trial's unknowns begin, by default as its first samples say.
    """
    if not model.own_unknowns():
        return [(np.ones(len(trial), dtype=bool), {})]
    outputs, values = [n for n in model.rig.outputs(trial.kind) if n in trial.columns], model.parameters()
    out = []
    for half in halves(len(trial)):
        masked = {n: np.where(half, np.nan, trial[n]) for n in outputs}
        shown = derived_trial(trial, columns={**trial.columns, **masked})
        problem = LikelihoodProblem(model, [shown], noise, (), starts=[trial])
        (now,) = [dict(start)] if start else problem.start_unknowns()
        spread = {n: d for n, d in spread_of_start(model, trial).items() if n in problem.unknown_names}
        reach = {n: (now[n] - d, now[n] + d) for n, d in spread.items()}
        for _ in range(STEPS):
            (part,) = problem.linearize(values, [now])
            now = _moved(part, problem.unknown_names, now, reach)
        out.append((half, {n: now[n] for n in model.own_unknowns()}))
    return out


def _moved(
    part: Linearized, names: Sequence[str], now: Mapping[str, float], reach: Mapping[str, tuple[float, float]]
) -> dict[str, float]:
    """A step of least squares from where unknowns are now; where some would leave their reach, the others follow."""
    step = dict(zip(names, least_squares(part.local, part.residual, rcond=1e-6), strict=True))
    kept = {n: float(np.clip(step[n], low - now[n], high - now[n])) for n, (low, high) in reach.items()}
    if any(kept[n] != step[n] for n in kept):
        others = [k for k, n in enumerate(names) if n not in kept]
        left = part.residual - part.local @ [kept.get(n, 0.0) for n in names]
        free = least_squares(part.local[:, others], left, rcond=1e-6)
        step = {**kept, **{names[k]: d for k, d in zip(others, free, strict=True)}}
    return {**now, **{n: now[n] + float(d) for n, d in step.items()}}


def amplitude(fitted: Fit, effect: Effect) -> tuple[float, float]:
    """Size of an effect whose amplitudes are each trial's own: the root mean square of their length, and its deviation.

    The mean is over the trials of the kind that comes first among those that feel the effect, as a motion and a force
    have no unit in common; what the uncertainty of the single values adds to their squares is taken off.
    """
    if isinstance(fitted.noise, StateSpaceNoise):
        names = unknown_names(fitted.model, fitted.noise, fitted.trials)
    else:
        names = (*fitted.model.rig.unknowns(fitted.trials[0].kind), *fitted.model.own_unknowns())
    own = np.array([names.index(f"{effect.name}.{n}") for n in effect.unknowns()])
    slopes = [slope for _, slope in normal_equations(fitted.parts).eliminated]
    squares, spread, kind = [], [], None
    for trial, part, unknowns, slope in zip(fitted.trials, fitted.parts, fitted.unknowns, slopes, strict=True):
        felt = np.flatnonzero(part.local.any(axis=0))
        if not np.isin(own, felt).all() or (kind or trial.kind) != trial.kind:
            continue
        kind = trial.kind
        value = np.array([unknowns[names[k]] for k in own])
        variance = np.linalg.pinv(part.local[:, felt].T @ part.local[:, felt], hermitian=True)
        mine = np.searchsorted(felt, own)
        free = np.isfinite(np.diag(fitted.covariance))
        shared = slope[np.ix_(own, free)] @ fitted.covariance[np.ix_(free, free)] @ slope[np.ix_(own, free)].T
        covariance = variance[np.ix_(mine, mine)] + shared
        squares.append(float(value @ value - np.trace(covariance)))
        spread.append(float(value @ covariance @ value))
    if not squares:
        return 0.0, math.inf
    size = math.sqrt(max(float(np.mean(squares)), 0.0))
    deviation = math.sqrt(sum(spread)) / len(spread)
    return size, deviation / size if size > 0 else math.inf
