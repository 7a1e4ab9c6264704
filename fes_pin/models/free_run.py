"""Runs of a model along measured trials without process noise: free, and held on the measured motion by a servo.

A free simulation gives one-step predictions. The effort of a stiff servo that keeps the model on the motion is what the
model lacks. The servo acts on the difference of measured and modelled reading and on its rate, critically damped:

    torque + J (w^2 (y - reading) + 2 w (y' - v)),   w = 2 pi BANDWIDTH_HZ

Below its bandwidth that is the effort which would have made the model right, effects of the model included. Unlike a
free simulation it stays near the motion of a rig that integrates or falls over.

Source: Ohnishi, Shibata and Murakami, Motion control for advanced mechatronics, IEEE/ASME Transactions on Mechatronics
1 (1996): the effort of a servo as an observer of disturbances.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fes_pin.data.trial import Trial, derived_trial
from fes_pin.infer.noise import NoiseModel, thin, thinning
from fes_pin.models.model import Model
from fes_pin.models.predictions import PredictedTrial, Readings
from fes_pin.models.predictor import StateSpaceNoise, measured_outputs, read_columns
from fes_pin.models.simulate import EachTrial, Simulated, Simulator, Values
from fes_pin.models.stage import Effect, Stage


class FreeRun:
    """A free simulation of measured trials for any values of a model's parameters.

    It gives the same as a `Predictor` without process noise, in which readings do not correct the state.

    Parameters
    ----------
    model
        Its structure and constants are used; the values of its parameters are given to `run`.
    trials
        MeasuredOutputs trials; samples that were not measured are NaN.
    columns
        Parameters, and unknowns of trials and effects, of the sensitivities.
    noise
        Measurement noise by output column, for its time step or its correlation time; columns without noise are left
        out.
    """

    def __init__(self, model: Model, trials: Sequence[Trial], columns: tuple[str, ...], noise: NoiseModel) -> None:
        self._simulator = Simulator(model, trials, columns)
        self._read = [MeasuredOutputs(model, t, noise) for t in trials]

    def run(
        self, values: Values, noise: NoiseModel | Sequence[NoiseModel], unknowns: EachTrial
    ) -> list[PredictedTrial]:
        """Simulate every trial; see `Predictor.run`."""
        each = [noise] * len(self._read) if isinstance(noise, Mapping) else noise
        run = self._simulator.run(values, unknowns)
        return [read.predicted(one, own) for read, one, own in zip(self._read, run, each, strict=True)]


class MeasuredOutputs:
    """The measured outputs of a trial that have noise, averaged to its time step."""

    def __init__(self, model: Model, trial: Trial, noise: NoiseModel) -> None:
        outputs = tuple(n for n in measured_outputs(model, trial) if n in noise)
        correlation_s = noise.correlation_s if isinstance(noise, StateSpaceNoise) else None
        read = read_columns(model.rig, trial, outputs, correlation_s)
        self.places = [model.rig.outputs(trial.kind).index(n) for n in outputs]
        self.measured, self.seen = read.measured, read.readings.seen
        self.count = thinning(trial.dt, max((noise[n].step_s for n in outputs), default=0.0))
        self.repeated, self.readings = thin(read.repeated, self.count), read.readings
        if self.count > 1:
            seen = thin(self.seen.astype(float), self.count) == 1.0
            self.readings = Readings(outputs, seen, thin(read.readings.repeats, self.count))

    def predicted(self, one: Simulated, noise: NoiseModel) -> PredictedTrial:
        """Return the trial as simulated, at a noise."""
        own = [noise[n] for n in self.readings.outputs]
        white, ar = tuple(n.innovation_std for n in own), tuple(n.ar for n in own)
        first = self.places == list(range(len(self.places)))
        at = slice(len(self.places)) if first else self.places  # a slice needs no copy
        missed = thin(np.where(self.seen, self.measured - one.readings[:, at], 0.0), self.count)
        moved = thin(one.sensitivities[:, at], self.count)
        return PredictedTrial(self.readings, missed, self.repeated * np.square(white), moved, white, ar)


def with_noise(one: PredictedTrial, noise: StateSpaceNoise) -> PredictedTrial:
    """Return a simulated trial with another measurement noise."""
    white, ar = tuple(noise.white[n] for n in one.outputs), tuple(noise.ar.get(n, ()) for n in one.outputs)
    return replace(one, variances=one.variances * np.square(np.divide(white, one.white)), white=white, ar=ar)


BANDWIDTH_HZ = 8.0
"""Bandwidth above that of limbs and muscles: voluntary motion ends near 5 Hz (Winter, Biomechanics and Motor Control of
Human Movement, 4th ed., section 3.4.4, finds 99.7 % of a gait's power below 6 Hz)."""
FINE = 0.05
"""Longest sample of the servo, in radians of its bandwidth."""


@dataclass(frozen=True)
class TrackingEffort(Effect):
    """The servo's effort, added to the effort that drives the joint; see the module.

    torque + J (w^2 (y - reading) + 2 w (y' - v))
    """

    name, stage, signal, rigs = "tracking_effort", Stage.JOINT, "torque", ("joint",)
    inputs = ("tracked", "tracked_rate")

    def apply(self, value: Any, s: Any) -> Any:
        s.rest_reading, s.idle_reading = s.m.rest, s.c.idle
        reading = s.through("reading", s.x.q)
        return value + s.inertia * _servo(s.u.tracked - reading, s.u.tracked_rate - s.x.v)


def _servo(behind: Any, slower: Any) -> Any:
    """Return the acceleration that the servo demands."""
    w = 2.0 * math.pi * BANDWIDTH_HZ
    return w * w * behind + 2.0 * w * slower


def can_track(model: Model) -> bool:
    """Return whether a model is of a joint, whose simulation gives both position and rate."""
    return model.rig.name in TrackingEffort.rigs


def measured_motion(trial: Trial, output: str) -> tuple[np.ndarray, np.ndarray]:
    """Return position and rate of a measured motion by cubics over a quarter of the servo's period, shape (n,) each.

    Source: Savitzky and Golay, Smoothing and differentiation of data by simplified least squares procedures, Analytical
    Chemistry 36 (1964).
    """
    from scipy.signal import savgol_filter  # noqa: PLC0415 - a third of a second, for driven rigs alone

    width = min(max(5, 2 * round(0.125 / (BANDWIDTH_HZ * trial.dt)) + 1), len(trial) - 1 + len(trial) % 2)
    if width < 5:
        return trial[output], np.gradient(trial[output], trial.dt)
    given = (trial[output], width, 3)
    return savgol_filter(*given), savgol_filter(*given, deriv=1, delta=trial.dt)


def tracking_effort(model: Model, trial: Trial, position: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return the effort to add to a joint's effort for it to move as measured, shape (n,), N m (N if prismatic).

    Parameters
    ----------
    model
        The model with its effects.
    trial
        The measured trial, whose effort acts.
    position, rate
        Position and rate of the measured motion, shape (n,).
    """
    from scipy.interpolate import CubicHermiteSpline  # noqa: PLC0415 - as above

    count = max(1, math.ceil(trial.dt * 2.0 * math.pi * BANDWIDTH_HZ / FINE))
    finer = _finer(trial, count)
    curve = CubicHermiteSpline(trial.time, position, rate)
    wanted = [curve(finer.time), curve(finer.time, 1)]
    servo = model + TrackingEffort()
    tracked = {"tracked": _held(wanted[0]), "tracked_rate": _held(wanted[1])}
    given = derived_trial(finer, columns={**finer.columns, **tracked})
    simulator = Simulator(servo, [given])
    (run,) = simulator.run(servo.parameters(), [{**model.initial_unknowns(trial), "initial_velocity": float(rate[0])}])
    inertia = float(getattr(model.rig, "inertia_scale")) * float(model.rig.constants["inertia"])  # noqa: B009
    added = inertia * _servo(*(_held(y) - _held(run.readings[:, k]) for k, y in enumerate(wanted)))
    return np.asarray(added)[::count]


def _finer(trial: Trial, count: int) -> Trial:
    """Return a trial with `count` samples in the place of each, inputs held: a servo at few samples ripples."""
    if count == 1:
        return trial
    time = trial.time[0] + trial.dt / count * np.arange(count * (len(trial) - 1) + 1)
    columns = {n: np.repeat(v, count)[: len(time)] for n, v in trial.columns.items()}
    return derived_trial(trial, time=time, columns=columns)


def _held(values: np.ndarray) -> np.ndarray:
    """Return the mean of each sample and the next: the value that is held between them without a delay."""
    return np.append(0.5 * (values[1:] + values[:-1]), values[-1])
