"""Predictions and sizes of effects whose amplitudes have a value of their own in every trial.

Such an amplitude is unknown before its trial is measured, and a prediction from inputs alone leaves the effect out. A
measured trial is cut into `SEGMENTS` pieces. The amplitudes that predict the odd pieces are estimated from the even
ones and vice versa (cross-fitting), so that no sample takes part in its own prediction.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from functools import partial

import numpy as np

from fes_pin.data.trial import Trial, derived_trial
from fes_pin.identify.fit import fit_problem, from_beginnings
from fes_pin.identify.likelihood import LikelihoodProblem, is_simulated
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.identify.problem import Problem, unknown_names
from fes_pin.identify.process_noise import first_guess, spread_of_start
from fes_pin.infer.covariance import covariance_of, least_squares_step
from fes_pin.infer.levels import RUNAWAY
from fes_pin.infer.noise import NoiseModel
from fes_pin.infer.optimum import Optimum, minimise
from fes_pin.infer.problem import Linearized, Unknowns, completed, normal_equations
from fes_pin.infer.scatter import with_honest_intervals
from fes_pin.models.least_squares import least_squares
from fes_pin.models.model import Model
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.models.simulate import Simulator
from fes_pin.models.stage import Effect

SEGMENTS = 4
"""Pieces of a trial. With two, a slow oscillation would have to be predicted over half a trial; many short pieces would
share slow noise."""
STEPS = 12
"""Most Gauss-Newton steps, each as long as lowers the cost most; amplitudes that are nearly linear take three."""


def predictions(model: Model, trial: Trial, noise: NoiseModel, known: Unknowns | None = None) -> np.ndarray:
    """Return the readings that a model predicts of a measured trial, shape (n, outputs); see the module.

    A simulation starts from the first readings; that of a rig that falls, from an initial state that is fitted.

    Parameters
    ----------
    noise
        Noise by output column, by which channels are weighted.
    known
        Unknowns of the trial, of a fit to it; by default none is known.
    """
    simulator, values, outputs = Simulator(model, [trial]), model.parameters(), model.rig.outputs(trial.kind)
    white = StateSpaceNoise({n: max(noise[n].std, 1e-12) if n in noise else math.inf for n in outputs})
    start = simulator.start(values)
    if known:
        start = completed(start, known)
    elif falls(model, [trial]):
        problem = Problem(model, [trial], white, ())
        start = from_beginnings(problem, fit_problem(problem, values), partial(fit_problem, problem)).unknowns
    (begun,) = start
    each = cross_fitted_unknowns(model, trial, white, begun)
    runs = [simulator.run(values, [{**begun, **own}])[0].readings for _, own in each]
    return np.where(each[0][0][:, None], runs[0], runs[-1])


def falls(model: Model, trials: Sequence[Trial]) -> bool:
    """Return whether a free simulation enlarges an initial error by more than `RUNAWAY`: the rig falls by itself."""
    unknowns = tuple(dict.fromkeys(n for t in trials for n in model.rig.unknowns(t.kind)))
    if not unknowns:
        return False
    simulator = Simulator(model, trials, unknowns)
    with np.errstate(all="ignore"):
        run = simulator.run(model.parameters(), simulator.start(model.parameters()))
        largest = max(float(np.abs(one.sensitivities[:, 0, 0]).max()) for one in run)
    return not largest < RUNAWAY


def halves(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the odd pieces of a trial and the even ones, as masks of shape (n,)."""
    first = (np.arange(count) * SEGMENTS // count) % 2 == 0
    return first, ~first


def cross_fitted_unknowns(
    model: Model, trial: Trial, noise: StateSpaceNoise, start: Mapping[str, float] | None = None
) -> list[tuple[np.ndarray, dict[str, float]]]:
    """Return the samples of each half, shape (n,), with unknowns of effects estimated by the likelihood from the other.

    Without effects that have amplitudes of a trial's own, one pair holds all samples. Where the rig is simulated, the
    initial state is estimated together with them, no farther from the start than `spread_of_start`, since the other
    half may not determine it. White noise estimates sinusoids as well as the right noise does (Grenander 1954). A zero
    or a scale does not depend on the time since the trial began: it is begun at the estimate of a filter that begins
    again after each gap, since a free simulation of a rig that falls, or turns over, has many minima.

    Parameters
    ----------
    start
        Start values of the trial's unknowns; by default from its first samples.
    """
    if not model.own_unknowns():
        return [(np.ones(len(trial), dtype=bool), {})]
    cut = spread_of_start(model, trial) and all(e.is_fault for e in model.effects if e.each_trial)
    out = []
    for half in halves(len(trial)):
        own = _filtered(model, pieces(trial, ~half), noise) if cut else {}
        known = cut and noise.processes
        out.append((half, own if known else _fitted_without(half, model, trial, noise, {**(start or {}), **own})))
    return out


def _fitted_without(
    half: np.ndarray, model: Model, trial: Trial, noise: StateSpaceNoise, start: Mapping[str, float]
) -> dict[str, float]:
    """Return unknowns of effects, estimated from the samples of a trial that are not in a half."""
    outputs, values = [n for n in model.rig.outputs(trial.kind) if n in trial.columns], model.parameters()
    masked = {n: np.where(half, np.nan, trial[n]) for n in outputs}
    shown = derived_trial(trial, columns={**trial.columns, **masked})
    problem = LikelihoodProblem(model, [shown], noise, (), starts=[trial])
    now = {**problem.start_unknowns()[0], **start}
    spread = {n: d for n, d in spread_of_start(model, trial).items() if n in problem.unknown_names}
    reach = {n: (now[n] - d, now[n] + d) for n, d in spread.items()}
    for _ in range(STEPS):
        (part,) = problem.linearize(values, [now])
        there, was = _moved(part, problem.unknown_names, now, reach), now
        tried = [{n: v + 0.5**k * (there[n] - v) for n, v in was.items()} for k in range(problem.batch)]
        costs = problem.costs([(values, [one]) for one in (was, *tried)])
        now = (was, *tried)[int(np.argmin(np.nan_to_num(costs, nan=np.inf)))]
        if now is was:
            break
    return {n: now[n] for n in model.own_unknowns()}


def pieces(trial: Trial, rows: np.ndarray) -> list[Trial]:
    """Return the stretches of a trial in which `rows`, shape (n,), is True."""
    ends = np.flatnonzero(np.diff(rows, prepend=False, append=False))
    return [trial.part(slice(int(a), int(b))) for a, b in zip(ends[::2], ends[1::2], strict=True)]


def _filtered(model: Model, trials: Sequence[Trial], noise: StateSpaceNoise) -> dict[str, float]:
    """Return the mean of unknowns that a filter estimates in pieces of one trial, weighted by their information."""
    names, noisy = model.own_unknowns(), noise if noise.processes else first_guess(model, trials)
    found = minimise(LikelihoodProblem(model, trials, noisy, ()), model.parameters())
    known = [p.local.T @ p.local for p in found.parts]
    moved = [h @ [u[n] for n in names] for h, u in zip(known, found.unknowns, strict=True)]
    return dict(zip(names, map(float, least_squares_step(np.sum(known, axis=0), np.sum(moved, axis=0))), strict=True))


def _moved(
    part: Linearized, names: Sequence[str], now: Mapping[str, float], reach: Mapping[str, tuple[float, float]]
) -> dict[str, float]:
    """Return unknowns after a step of least squares; where some would leave their bounds, the others are adapted."""
    step = dict(zip(names, least_squares(part.local, part.residual, rcond=1e-6), strict=True))
    kept = {n: float(np.clip(step[n], low - now[n], high - now[n])) for n, (low, high) in reach.items()}
    if any(kept[n] != step[n] for n in kept):
        others = [k for k, n in enumerate(names) if n not in kept]
        left = part.residual - part.local @ [kept.get(n, 0.0) for n in names]
        free = least_squares(part.local[:, others], left, rcond=1e-6)
        step = {**kept, **{names[k]: d for k, d in zip(others, free, strict=True)}}
    return {**now, **{n: now[n] + float(d) for n, d in step.items()}}


def as_parameters(fitted: LikelihoodFit, effect: Effect) -> Optimum:
    """Return the optimum of a fit with each trial's own amplitudes of an effect as parameters of all.

    In order of trials they are `name@0`, `name@1` and so on.
    """
    names = unknown_names(fitted.model, fitted.trials, is_simulated(fitted.noise, fitted.trials))
    at = [names.index(f"{effect.name}.{n}") for n in effect.unknowns()]
    own = {f"{names[k]}@{i}": u[names[k]] for i, u in enumerate(fitted.unknowns) for k in at}
    parts = [
        replace(p, jacobian=np.c_[p.jacobian, np.kron(row, p.local[:, at])], local=np.delete(p.local, at, axis=1))
        for p, row in zip(fitted.parts, np.eye(len(fitted.parts)), strict=True)
    ]
    moving = np.array([n not in fitted.at_bound for n in (*fitted.free, *own)])
    known = {f.name: getattr(fitted, f.name) for f in fields(Optimum)}
    known |= {"free": (*fitted.free, *own), "parameters": {**fitted.parameters, **own}, "parts": parts}
    return Optimum(**{**known, "covariance": covariance_of(normal_equations(parts).hessian, moving)})


def amplitude(fitted: LikelihoodFit, effect: Effect) -> tuple[float, float]:
    """Return the root mean square size of an effect with amplitudes of each trial's own, and its standard deviation.

    The mean is over the trials of the first kind in which the effect acts, as a motion and a force have no common unit.
    The variance of the single estimates is subtracted from their squares.
    """
    whole, sizes, kind = with_honest_intervals(as_parameters(fitted, effect)), [], None
    for i, trial in enumerate(fitted.trials):
        own = [f"{effect.name}.{n}@{i}" for n in effect.unknowns()]
        at = [whole.place(n) for n in own]
        value, covariance = np.array([whole.parameters[n] for n in own]), whole.covariance[np.ix_(at, at)]
        if np.isfinite(covariance).all() and (kind or trial.kind) == trial.kind:
            kind = trial.kind
            sizes.append((float(value @ value - np.trace(covariance)), float(value @ covariance @ value)))
    if not sizes:
        return 0.0, math.inf
    squares, spread = zip(*sizes, strict=True)
    size = math.sqrt(max(float(np.mean(squares)), 0.0))
    deviation = math.sqrt(sum(spread)) / len(spread)
    return size, deviation / size if size > 0 else math.inf
