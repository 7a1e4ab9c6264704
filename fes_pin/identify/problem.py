"""Whitened residuals and sensitivities of a free simulation of trials."""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np

from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial
from fes_pin.infer import problem as infer
from fes_pin.infer.noise import NoiseModel, thinning
from fes_pin.infer.problem import Linearized, Unknowns
from fes_pin.models.least_squares import least_squares
from fes_pin.models.model import Model
from fes_pin.models.parameters import ParameterInfo
from fes_pin.models.simulate import Simulated, SimulatedBatch, Simulator
from fes_pin.workers import check_limit

NEXT_TO = 1e-6
"""Distance in scales that a parameter which switches on a form with a memory keeps from its null: far below what data
resolve."""


class Problem(infer.Problem):
    """A model structure on trials, with the noise that weights their residuals.

    Parameters
    ----------
    model
        Its structure; values are given to the methods.
    trials
        Measured trials.
    noise
        Noise by output column; a column without noise has no weight.
    free
        The parameters of the sensitivities; by default the fitted ones of the model.
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
        self._read: dict[tuple[int, ...], np.ndarray] = {}

    @cached_property
    def products(self) -> list[tuple[int, int]]:
        """Places in `free` of shapes and of the amplitudes that they multiply."""
        return products_of(self.free, self.model.parameter_info())

    def start_unknowns(self) -> Unknowns:
        """Return start values of the unknowns of each trial, from its first samples."""
        return [self.model.initial_unknowns(t) for t in self.trials]

    def residuals(self, values: Mapping[str, float], unknowns: Unknowns) -> list[dict[str, np.ndarray]]:
        """Return measured minus simulated, for each trial by output column; not whitened."""
        run = self.simulator.run(values, unknowns)
        return [self._left(trial, simulated) for trial, simulated in zip(self.trials, run, strict=True)]

    def _left(self, trial: Trial, simulated: Simulated) -> dict[str, np.ndarray]:
        names = self.model.rig.outputs(trial.kind)
        return {n: trial[n] - simulated.readings[:, k] for k, n in enumerate(names) if n in trial.columns}

    def settled(self, values: Mapping[str, float], unknowns: Unknowns) -> list[dict[str, np.ndarray]]:
        """Return the residuals after a least-squares step of each trial's initial state."""
        rig, out = self.model.rig, []
        for trial, simulated in zip(self.trials, self.simulator.run(values, unknowns), strict=True):
            left = self._left(trial, simulated)
            own = [self.simulator.columns.index(n) for n in rig.unknowns(trial.kind)]
            if own:
                scale = {n: self.noise[n].std if n in self.noise else math.inf for n in left}
                outputs = rig.outputs(trial.kind)
                moved = {n: simulated.sensitivities[:, outputs.index(n), own] for n in left}
                joined = np.concatenate([moved[n] / scale[n] for n in left])
                step = least_squares(joined, np.concatenate([left[n] / scale[n] for n in left]))
                left = {n: left[n] - moved[n] @ step for n in left} if step.any() else left
            out.append(left)
        return out

    def linearize(self, values: Mapping[str, float], unknowns: Unknowns) -> list[Linearized]:
        """Return whitened residuals and sensitivities at a parameter value; stops at a limit of time."""
        check_limit()
        out: list[Linearized | None] = [None] * len(self.trials)
        for block in self.simulator.run_batches(values, unknowns):
            for i, part in zip(block.trials, self._whitened(block), strict=True):
                out[i] = part
        return [p for p in out if p is not None]

    def _whitened(self, block: SimulatedBatch) -> Iterator[Linearized]:
        """Yield the trials of a simulated batch, whitened as a batch."""
        trials = [self.trials[i] for i in block.trials]
        pieces: list[list[tuple[np.ndarray, np.ndarray]]] = [[] for _ in trials]
        missed = self._measured(block) - block.readings
        for k, name in enumerate(self.model.rig.outputs(trials[0].kind)):
            if name not in self.noise:
                continue
            noise = self.noise[name]
            counts = [thinning(t.dt, noise.step_s) for t in trials]
            for count in dict.fromkeys(counts):
                dt = trials[counts.index(count)].dt
                residuals, moved = noise.whiten(missed[:, k], dt), noise.whiten(block.sensitivities[:, k], dt)
                for lane, trial in enumerate(trials):
                    if counts[lane] == count and name in trial.columns:
                        rows = noise.innovations(len(trial), dt)
                        pieces[lane].append((residuals[:rows, lane], moved[:rows, :, lane]))
        return (self._linearized(own, block.columns) for own in pieces)

    def _measured(self, block: SimulatedBatch) -> np.ndarray:
        """Return the measured outputs of the trials of a batch, in its layout; zero where nothing was measured."""
        if block.trials not in self._read:
            out = np.zeros(block.readings.shape)
            for lane, trial in enumerate(self.trials[i] for i in block.trials):
                for k, name in enumerate(self.model.rig.outputs(trial.kind)):
                    if name in trial.columns:
                        out[: len(trial), k, lane] = trial[name]
            self._read[block.trials] = out
        return self._read[block.trials]

    def _linearized(self, pieces: Sequence[tuple[np.ndarray, np.ndarray]], columns: Sequence[int]) -> Linearized:
        """Return one trial from the whitened residuals of its channels and their sensitivities to some columns."""
        split = len(self.free)
        count, width = sum(len(r) for r, _ in pieces), split + len(self.unknown_names)
        residual, rows, at = np.empty(count), np.zeros((count, width)), 0
        places = slice(None) if len(columns) == width else list(columns)
        for own, moved in pieces:
            here = slice(at, at + len(own))
            residual[here], rows[here, places], at = own, moved, here.stop
        return Linearized(residual, rows[:, :split], rows[:, split:])


def products_of(names: Sequence[str], info: Mapping[str, ParameterInfo]) -> list[tuple[int, int]]:
    """Return places of shapes and of the amplitudes that they multiply, within one group where there are groups."""
    out = []
    for at, name in enumerate(names):
        path, mark, group = name.partition("@")
        amplitude = f"{path.rpartition('.')[0]}.{info[name].times}{mark}{group}"
        if info[name].times and amplitude in names:
            out.append((at, names.index(amplitude)))
    return out


def measured_columns(model: Model, trials: Sequence[Trial]) -> dict[str, np.ndarray]:
    """Return every measured output, imposed motion and effort, all trials end to end, by column name.

    `time` since each trial began, s; `reading` the first output of each that passes a sensor.
    """
    out: dict[str, list[np.ndarray]] = {"time": [t.time - t.time[0] for t in trials]}
    rig = model.rig
    for trial in trials:
        for name in dict.fromkeys((*rig.outputs(trial.kind), *rig.schema.motion(trial.kind), "effort")):
            if name in trial.columns:
                out.setdefault(name, []).append(trial[name])
        if rig.output(trial.kind) in trial.columns and "reading" in rig.signals(trial.kind):
            out.setdefault("reading", []).append(trial[rig.output(trial.kind)])
    return {n: np.concatenate(v) for n, v in out.items()}


def answered_columns(model: Model, trials: Sequence[Trial]) -> dict[str, np.ndarray]:
    """Return the same for a rig in closed loop, with the effort of its controller as `answer`."""
    measured = measured_columns(model, trials)
    if "effort" in measured and not any(t.kind == IMPOSED for t in trials):
        measured["answer"] = measured["effort"]
    return measured


def limits_of(model: Model, trials: Sequence[Trial]) -> dict[str, tuple[float, float]]:
    """Return bounds of every parameter on these trials, by name.

    Where a form of an effect has a state or a memory of its own, the parameter that switches it on keeps off its null:
    at the null the model is another one, without that state.
    """
    limits = {n: (i.lower, i.upper) for n, i in model.parameter_info().items()}
    measured = measured_columns(model, trials) if model.effects else {}
    for effect in model.effects:
        for n, (low, high) in effect.limits(measured).items():
            name = f"{effect.name}.{n}"
            if name not in limits:  # of each trial's own
                continue
            limits[name] = (max(limits[name][0], low), min(limits[name][1], high))
        for n in set(effect.of_form.values()) & set(effect.refined()):
            (low, high), one = limits[f"{effect.name}.{n}"], effect.parameters()[n]
            limits[f"{effect.name}.{n}"] = (min(low + NEXT_TO * one.scale, high) if low == one.null else low, high)
    return limits
