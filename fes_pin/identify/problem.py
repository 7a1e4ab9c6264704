"""Whitened residuals and sensitivities of a model on trials, and their normal equations."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.identify.noise import NoiseModel
from fes_pin.models.model import Model
from fes_pin.models.simulate import Simulated, Simulator

Unknowns = list[dict[str, float]]
SINGULAR = 1e-12
"""Share of an unknown's own information added to it: two that the trial cannot tell apart do not stop a fit."""

STEEPEST = 1e120
"""Sensitivities beyond this, in deviations of the noise per unit, count as infinite: their squares would be."""


@dataclass(frozen=True)
class Linearized:
    """One trial near a parameter value: whitened residual and sensitivities, all channels end to end.

    Attributes
    ----------
    residual
        Shape (m,).
    jacobian
        Shape (m, parameters): derivative of the simulation, so the residual falls along it.
    local
        Shape (m, unknowns of the trial).
    """

    residual: np.ndarray
    jacobian: np.ndarray
    local: np.ndarray


class Problem:
    """A model structure on trials, with the noise that weighs them.

    Parameters
    ----------
    model
        Its structure; values are given to the methods.
    trials
        What was measured.
    noise
        By output column; a column that is missing here weighs nothing.
    free
        The parameters that sensitivities are wanted for; the model's fitted ones by default.
    """

    def __init__(
        self,
        model: Model,
        trials: Sequence[Trial],
        noise: NoiseModel,
        free: tuple[str, ...] | None = None,
    ) -> None:
        self.model, self.trials, self.noise = model, tuple(trials), noise
        self.free = model.fitted_parameters() if free is None else free
        self.limits = limits_of(model, self.trials)
        initial = dict.fromkeys(n for t in self.trials for n in model.rig.unknowns(t.kind))
        self.unknown_names = (*initial, *model.own_unknowns()) if self.trials else ()
        self.simulator = Simulator(model, self.trials, (*self.free, *self.unknown_names))

    def start_unknowns(self) -> Unknowns:
        """The unknowns of each trial as its first samples suggest."""
        return [self.model.initial_unknowns(t) for t in self.trials]

    def completed(self, unknowns: Unknowns) -> Unknowns:
        """Unknowns of another model on these trials with what this one has besides, without what it has not."""
        both = zip(self.start_unknowns(), unknowns, strict=True)
        return [{n: known.get(n, value) for n, value in start.items()} for start, known in both]

    def residuals(self, values: Mapping[str, float], unknowns: Unknowns) -> list[dict[str, np.ndarray]]:
        """Measured minus simulated, for each trial by output column; not whitened."""
        run = self.simulator.run(values, unknowns)
        return [self._left(trial, simulated) for trial, simulated in zip(self.trials, run, strict=True)]

    def _left(self, trial: Trial, simulated: Simulated) -> dict[str, np.ndarray]:
        names = self.model.rig.outputs(trial.kind)
        return {n: trial[n] - simulated.readings[:, k] for k, n in enumerate(names) if n in trial.columns}

    def settled(self, values: Mapping[str, float], unknowns: Unknowns) -> list[dict[str, np.ndarray]]:
        """The residuals without what a step of each trial's initial state takes out of them by least squares."""
        rig, out = self.model.rig, []
        for trial, simulated in zip(self.trials, self.simulator.run(values, unknowns), strict=True):
            left = self._left(trial, simulated)
            own = [self.simulator.columns.index(n) for n in rig.unknowns(trial.kind)]
            if own and np.isfinite(simulated.sensitivities).all():
                scale = {n: self.noise[n].std if n in self.noise else math.inf for n in left}
                outputs = rig.outputs(trial.kind)
                moved = {n: simulated.sensitivities[:, outputs.index(n), own] for n in left}
                joined = np.concatenate([moved[n] / scale[n] for n in left])
                step = np.linalg.lstsq(joined, np.concatenate([left[n] / scale[n] for n in left]), rcond=1e-9)[0]
                left = {n: left[n] - moved[n] @ step for n in left}
            out.append(left)
        return out

    def linearize(self, values: Mapping[str, float], unknowns: Unknowns) -> list[Linearized]:
        """Whitened residuals and sensitivities at a parameter value."""
        out, split = [], len(self.free)
        for trial, simulated in zip(self.trials, self.simulator.run(values, unknowns), strict=True):
            residuals, sensitivities = [], []
            for k, name in enumerate(self.model.rig.outputs(trial.kind)):
                if name not in trial.columns or name not in self.noise:
                    continue
                noise = self.noise[name]
                residuals.append(noise.whiten(trial[name] - simulated.readings[:, k], trial.dt))
                sensitivities.append(noise.whiten(simulated.sensitivities[:, k], trial.dt))
            rows = np.concatenate(sensitivities) if len(sensitivities) > 1 else sensitivities[0]
            out.append(Linearized(np.concatenate(residuals), rows[:, :split], rows[:, split:]))
        return out


def measured_columns(model: Model, trials: Sequence[Trial]) -> dict[str, np.ndarray]:
    """Every measured output, all trials end to end, by column name; `time` since each trial began, s."""
    out: dict[str, list[np.ndarray]] = {"time": [t.time - t.time[0] for t in trials]}
    for trial in trials:
        for name in model.rig.outputs(trial.kind):
            if name in trial.columns:
                out.setdefault(name, []).append(trial[name])
    return {n: np.concatenate(v) for n, v in out.items()}


def limits_of(model: Model, trials: Sequence[Trial]) -> dict[str, tuple[float, float]]:
    """Bounds of every parameter on these trials, by name."""
    limits = {n: (i.lower, i.upper) for n, i in model.parameter_info().items()}
    measured = measured_columns(model, trials) if model.effects else {}
    for effect in model.effects:
        for n, (low, high) in effect.limits(measured).items():
            name = f"{effect.name}.{n}"
            if name not in limits:  # each trial's own
                continue
            limits[name] = (max(limits[name][0], low), min(limits[name][1], high))
    return limits


@dataclass(frozen=True)
class NormalEquations:
    """Gauss-Newton system with the unknowns of each trial eliminated.

    Attributes
    ----------
    sse
        Sum of squared whitened residuals.
    gradient, hessian
        Of half of it, shape (parameters,) and (parameters, parameters), after elimination.
    local_gain
        What steps of the trials' unknowns alone promise.
    """

    sse: float
    gradient: np.ndarray
    hessian: np.ndarray
    local_gain: float
    eliminated: tuple[tuple[np.ndarray, np.ndarray], ...]

    def local_steps(self, step: np.ndarray) -> list[np.ndarray]:
        """Steps of each trial's unknowns that go with a step of the parameters."""
        return [constant - slope @ step for constant, slope in self.eliminated]


def normal_equations(parts: Sequence[Linearized], damping: float = 0.0) -> NormalEquations:
    """Sum the trials; each trial's unknowns are eliminated by its Schur complement, damped as Marquardt does."""
    size = parts[0].jacobian.shape[1]
    sse, gradient, hessian, local_gain = 0.0, np.zeros(size), np.zeros((size, size)), 0.0
    eliminated = []
    for part in parts:
        r, j, local = part.residual, part.jacobian, part.local
        sse += float(r @ r)
        g, h = j.T @ r, j.T @ j
        if local.shape[1]:
            own = local.T @ local
            if not np.isfinite(own).all():
                return NormalEquations(math.inf, np.zeros(size), np.zeros((size, size)), 0.0, ())
            solved = _solved(own, np.column_stack([local.T @ r, local.T @ j]), damping)
            constant, slope = solved[:, 0], solved[:, 1:]
            g, h = g - j.T @ (local @ constant), h - j.T @ (local @ slope)
            eliminated.append((constant, slope))
            local_gain += float(r @ (local @ constant))
        gradient += g
        hessian += h
    return NormalEquations(sse, gradient, hessian, local_gain, tuple(eliminated))


def _solved(own: np.ndarray, right: np.ndarray, damping: float) -> np.ndarray:
    """Solution of a trial's own system, damped and scaled; an unknown that is not felt stays where it is."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(own), 1e-150))
    scaled = own * np.outer(scale, scale) + (damping + SINGULAR) * np.eye(len(own))
    return scale[:, None] * np.linalg.solve(scaled, scale[:, None] * right)


def whitened_sse(parts: Sequence[Linearized]) -> float:
    """Sum of squared whitened residuals; infinite where the simulation or its sensitivities run away."""
    with np.errstate(over="ignore", invalid="ignore"):
        total = float(sum(p.residual @ p.residual for p in parts))
    tame = all(float(np.abs(x).max(initial=0.0)) < STEEPEST for p in parts for x in (p.jacobian, p.local))
    return total if math.isfinite(total) and tame else math.inf
