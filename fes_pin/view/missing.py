"""The torque that a model lacks: a smoothed estimate of the input that would have made it right.

Let q_n be the angle that the nominal rig predicts and d the smoothed residual, so that q_n + d is the motion as
measured. With the rig's inertia J and its torque tau_n(q, v, act, u) the torque that is missing at each instant is

    missing = J d'' - [tau_n(q_n + d, v_n + d') - tau_n(q_n, v_n)]

which to first order is J d'' + damping d' + stiffness d, with the nominal inertia, damping and local stiffness; it is
not cut at first order. It is in N m for a revolute joint, in N for a prismatic one. Where nothing moves the missing
force is the smoothed residual itself, N; where the motion is imposed, so is the missing effort.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import scipy.linalg

from fes_pin.data.imposed import imposed_motion
from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial
from fes_pin.infer.noise import first_order_low_pass, thin
from fes_pin.models.model import Model
from fes_pin.models.rigs.base import Rig
from fes_pin.models.stage import Signals
from fes_pin.models.tracking import measured_motion, tracking_effort

MAX_POINTS = 1200
"""Instants of the estimate: a longer trial is averaged down to it first."""
PENALTIES = (-2.0, 10.0)
"""Range of the logarithm of the penalty; above it the system is singular in double precision."""
STEPS = 24
BINS, FEW = 16, 6
"""Bins of equal width, within which a function is taken as constant, and the values that one needs."""


@dataclass(frozen=True)
class Missing:
    """The effort that one model lacks in one trial.

    Attributes
    ----------
    trial
        Name of the trial.
    kind
        "torque" or "force"; "effort" of an imposed motion.
    unit
        "N m" or "N".
    value
        Shape (n,), in that unit.
    against
        Arrays of shape (n,) by name: "time_s", "angle" and "rate" of the measured motion, "activation" of the nominal
        muscle, and the stimulus by its column, where there are such.
    """

    trial: str
    kind: str
    unit: str
    value: np.ndarray
    against: Mapping[str, np.ndarray]


def missing_input(model: Model, measured: Trial, simulated: Trial) -> Missing:
    """The torque or force that a model lacks in a trial; see the module.

    Parameters
    ----------
    model
        The nominal model; only its rig is used.
    measured
        The trial.
    simulated
        What the model predicts of it.
    """
    rig = model.rig
    output = rig.output(measured.kind)
    count = max(1, math.ceil(len(measured) / MAX_POINTS))
    step = count * measured.dt
    residual = smooth(thin(measured.residual(simulated, output), count))
    stimulus = {n: thin(measured[n], count) for n in rig.input_columns(measured)}
    driven = {n: thin(v, count) for n, v in activation(rig, measured).items()}
    shown = {n: v for n, v in stimulus.items() if n != "stim"}  # a pulse is an event, not a value to plot against
    against = {"time_s": thin(measured.time - measured.time[0], count), **driven, **shown}
    force = rig.constants.get("revolute", 1.0) == 0.0
    if measured.kind == IMPOSED:
        position, velocity, _ = (thin(v, count) for v in imposed_motion(measured, rig.schema.imposed).values)
        against = {"angle": position, "rate": velocity, "time_s": against["time_s"]}
        return Missing(measured.name, "effort", "N" if force else "N m", residual, against)
    if "v" not in rig.states(measured.kind):
        return Missing(measured.name, "force", "N", residual, against)
    q = thin(simulated[output], count)
    v, rate = np.gradient(q, step), np.gradient(residual, step)
    without, inertia = nominal_torque(rig, measured, q, v, {**driven, **stimulus})
    moved, _ = nominal_torque(rig, measured, q + residual, v + rate, {**driven, **stimulus})
    value = inertia * np.gradient(rate, step) - (moved - without)
    against = {"angle": q + residual, "rate": v + rate, **against}
    return Missing(measured.name, "force" if force else "torque", "N" if force else "N m", value, against)


def missing_along(model: Model, measured: Trial) -> Missing:
    """The effort that a model, its effects included, lacks along the measured motion; see `models.tracking`.

    Of rigs whose effort answers what is read: they integrate or fall over, and a free simulation of them is no
    reference that a motion could be near to.
    """
    rig = model.rig
    output = rig.output(measured.kind)
    position, rate = measured_motion(measured, output)
    value = tracking_effort(model, measured, position, rate)
    count = max(1, math.ceil(len(measured) / MAX_POINTS))
    shown = {n: thin(measured[n], count) for n in rig.input_columns(measured)}
    motion = {"angle": position, "rate": rate, "time_s": measured.time - measured.time[0]}
    against = {**{n: thin(v, count) for n, v in motion.items()}, **shown}
    force = rig.constants.get("revolute", 1.0) == 0.0
    kind, unit = ("force", "N") if force else ("torque", "N m")
    return Missing(measured.name, kind, unit, thin(value, count), against)


def activation(rig: Rig, trial: Trial) -> dict[str, np.ndarray]:
    """Activation of the nominal muscle by name, shape (n,); nothing for a rig without one.

    The first-order lag answers a recruitment that is held between samples exactly.
    """
    if "act" not in rig.states(trial.kind):
        return {}
    s = _signals(rig, trial, {n: trial[n] for n in rig.input_columns(trial)})
    recruited = np.asarray(rig.sample(s)["r"], dtype=float) * np.ones(len(trial))
    pole = math.exp(-trial.dt / float(getattr(rig, "time_constant_s")))  # noqa: B009
    return {"activation": first_order_low_pass(np.r_[0.0, recruited[:-1]], pole)}


def nominal_torque(
    rig: Rig, trial: Trial, q: np.ndarray, v: np.ndarray, driven: Mapping[str, np.ndarray]
) -> tuple[np.ndarray, float]:
    """Torque of a rig on its joint along a motion, shape (n,), N m; and its inertia, kg m2 (N and kg if prismatic)."""
    s = _signals(rig, trial, driven)
    s.x = SimpleNamespace(q=q, v=v, act=driven.get("activation", 0.0))
    s.m = SimpleNamespace(r=0.0, r_before=0.0, rest=0.0)
    rig.rates(s)
    return np.asarray(s.torque, dtype=float) * np.ones(len(q)), float(s.inertia)


def _signals(rig: Rig, trial: Trial, inputs: Mapping[str, np.ndarray]) -> Signals:
    """Signals of a rig without effects, of whole trials at once."""
    constants = {**rig.trial_constants(trial), "dt": trial.dt}
    held: Any = SimpleNamespace(r=0.0, r_before=0.0, rest=0.0)
    return Signals(
        (),
        kind=trial.kind,
        m=held,
        u=SimpleNamespace(**inputs),
        c=SimpleNamespace(**constants),
        delayed=lambda now, _before: now,
    )


def smoothed(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Time and smooth curve of a signal of any length, by `smooth` on at most `MAX_POINTS` averages."""
    count = max(1, math.ceil(len(values) / MAX_POINTS))
    return thin(time, count), smooth(thin(values, count))


def smooth(values: np.ndarray) -> np.ndarray:
    """The smoothest curve that leaves no more than the noise, shape (n,).

    It minimises the sum of squared residuals plus a penalty on its third differences, which are small for a torque that
    changes little from instant to instant. The penalty is the largest whose residuals have the noise's standard
    deviation, which is estimated from second differences of the values (Morozov's discrepancy principle).
    """
    if len(values) < 12:
        return np.asarray(values, dtype=float)
    noise = 1.4826 * float(np.median(np.abs(np.diff(values, 2)))) / math.sqrt(6.0)
    low, high = PENALTIES
    for _ in range(STEPS):
        middle = 0.5 * (low + high)
        left = values - _penalised(values, 10.0**middle)
        low, high = (middle, high) if float(np.std(left)) < noise else (low, middle)
    return _penalised(values, 10.0**low)


def _penalised(values: np.ndarray, penalty: float) -> np.ndarray:
    """Whittaker's smoother with third differences D: (1 + penalty D' D) x = values."""
    difference = np.array([-1.0, 3.0, -3.0, 1.0])
    n = len(values)
    bands = np.zeros((4, n))
    for i in range(4):
        for j in range(i, 4):
            bands[3 - (j - i), j : n - 3 + j] += penalty * difference[i] * difference[j]
    bands[3] += 1.0
    return scipy.linalg.solveh_banded(bands, values)


def explained(value: np.ndarray, against: np.ndarray) -> float:
    """Share of the variance of a quantity that is a function of one variable alone: its correlation ratio, 0 to 1.

    Parameters
    ----------
    value, against
        Shape (n,).
    """
    size = float(np.abs(value).max(initial=0.0)) or 1.0  # a share has no unit, and squares of 1e200 no number
    groups = [g / size for _, g in binned(value, against)]
    seen = np.concatenate(groups)
    total = float(np.sum((seen - seen.mean()) ** 2))
    between = sum(len(g) * float(g.mean() - seen.mean()) ** 2 for g in groups)
    return between / total if total > 0 else 0.0


def binned(value: np.ndarray, against: np.ndarray) -> list[tuple[float, np.ndarray]]:
    """The values in bins of equal width of one variable: its median in each bin, and the values there.

    The outermost hundredth of the variable's values on either side goes to the outermost bins; bins with fewer than
    `FEW` values are left out.
    """
    low, high = np.quantile(against, (0.01, 0.99))
    if high - low < 1e-9 * max(1.0, abs(high)):
        return [(float(np.median(against)), value)]
    index = np.clip(((against - low) / (high - low) * BINS).astype(int), 0, BINS - 1)
    chosen = [np.flatnonzero(index == k) for k in range(BINS)]
    made = [(float(np.median(against[g])), value[g]) for g in chosen if len(g) >= FEW]
    return made or [(float(np.median(against)), value)]
