"""The effort that a model lacks along a measured motion: the effort of a stiff servo that keeps it there.

The servo acts on the difference of measured and modelled reading and on its rate, critically damped:

    torque + J (w^2 (y - reading) + 2 w (y' - v)),   w = 2 pi BANDWIDTH_HZ

Below its bandwidth that is the effort which would have made the model right, effects of the model included. Unlike a
free simulation it stays near the motion of a rig that integrates or falls over.

Source: Ohnishi, Shibata and Murakami, Motion control for advanced mechatronics, IEEE/ASME Transactions on Mechatronics
1 (1996): the effort of a servo as an observer of disturbances.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from fes_pin.data.trial import Trial, derived_trial
from fes_pin.models.model import Model
from fes_pin.models.simulate import Simulator
from fes_pin.models.stage import Effect, Stage

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
