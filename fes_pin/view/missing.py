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

import numpy as np
import scipy.linalg

from fes_pin.data.imposed import imposed_motion
from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial
from fes_pin.infer.noise import thin
from fes_pin.models.rigs.base import Rig
from fes_pin.models.stage import Signals

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

    kind: str
    unit: str
    value: np.ndarray
    against: Mapping[str, np.ndarray]


def missing_input(rig: Rig, measured: Trial, simulated: Trial) -> Missing:
    """Return the torque or force that a model of a rig lacks in a measured trial, of which it predicts a simulated one.

    See the module.
    """
    count = _averaged(measured.time)
    step = count * measured.dt
    unit, output = rig.units()["effort"], rig.output(measured.kind)
    kind, time = "force" if unit == "N" else "torque", thin(measured.time - measured.time[0], count)
    inputs = {n: thin(measured[n], count) for n in rig.input_columns(measured)}
    residual = smooth(thin(measured.residual(simulated, output), count))
    if measured.kind == IMPOSED:
        position, velocity, _ = (thin(v, count) for v in imposed_motion(measured, rig.schema.imposed).values)
        return Missing("effort", unit, residual, {"angle": position, "rate": velocity, "time_s": time})
    active = rig.activation(measured)
    driven = {**({} if active is None else {"activation": thin(active, count)}), **inputs}
    shown = {n: v for n, v in driven.items() if n != "stim"}  # a pulse is an event, not a value to plot against
    if "v" not in rig.states(measured.kind):
        return Missing("force", "N", residual, {"time_s": time, **shown})
    q = thin(simulated[output], count)
    v, slope = np.gradient(q, step), np.gradient(residual, step)
    without, inertia = nominal_torque(rig, measured, q, v, driven)
    moved, _ = nominal_torque(rig, measured, q + residual, v + slope, driven)
    against = {"angle": q + residual, "rate": v + slope, "time_s": time, **shown}
    return Missing(kind, unit, inertia * np.gradient(slope, step) - (moved - without), against)


def _averaged(values: np.ndarray) -> int:
    """Return how many samples are averaged into one of at most `MAX_POINTS`."""
    return max(1, math.ceil(len(values) / MAX_POINTS))


def nominal_torque(
    rig: Rig, trial: Trial, q: np.ndarray, v: np.ndarray, driven: Mapping[str, np.ndarray]
) -> tuple[np.ndarray, float]:
    """Return a rig's torque on its joint along a motion, (n,) N m, and its inertia, kg m2 (N and kg if prismatic)."""
    s = Signals(
        (),
        kind=trial.kind,
        x=SimpleNamespace(q=q, v=v, act=driven.get("activation", 0.0)),
        m=SimpleNamespace(r=0.0, r_before=0.0, rest=0.0),
        u=SimpleNamespace(**driven),
        c=SimpleNamespace(**rig.trial_constants(trial), dt=trial.dt),
        delayed=lambda now, _before: now,
    )
    rig.rates(s)
    return np.asarray(s.torque, dtype=float) * np.ones(len(q)), float(s.inertia)


def smoothed(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return time and smooth curve of a signal of any length, by `smooth` on at most `MAX_POINTS` averages."""
    count = _averaged(values)
    return thin(time, count), smooth(thin(values, count))


def smooth(values: np.ndarray) -> np.ndarray:
    """Return the smoothest curve that leaves no more than the noise, shape (n,).

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
    """Return what Whittaker's smoother with third differences D makes of them: (1 + penalty D' D) x = values."""
    difference = np.array([-1.0, 3.0, -3.0, 1.0])
    n = len(values)
    bands = np.zeros((4, n))
    for i in range(4):
        for j in range(i, 4):
            bands[3 - (j - i), j : n - 3 + j] += penalty * difference[i] * difference[j]
    bands[3] += 1.0
    return scipy.linalg.solveh_banded(bands, values)


def binned(value: np.ndarray, against: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the medians of a variable and of a quantity in bins of equal width of the variable.

    The outermost hundredth of the variable's values on either side goes to the outermost bins; bins with fewer than
    `FEW` values are left out.

    Parameters
    ----------
    value, against
        The quantity and the variable: shape (n,).

    Returns
    -------
    at, medians : ndarray
        Shape (bins,).
    share : float
        Share of the variance of the quantity that is a function of the variable alone: its correlation ratio, 0 to 1.
    """
    low, high = np.quantile(against, (0.01, 0.99))
    width = max((high - low) / BINS, 1e-9 * max(1.0, abs(high)) / BINS)
    index = np.clip((against - low) / width, 0, BINS - 1).astype(int)
    chosen = [np.flatnonzero(index == k) for k in range(BINS)]
    groups = [g for g in chosen if len(g) >= FEW] or [np.arange(len(value))]
    at, medians = (np.array([float(np.median(v[g])) for g in groups]) for v in (against, value))
    size = float(np.abs(value).max(initial=0.0)) or 1.0
    scaled = value / size  # a share has no unit, and squares of 1e200 no number
    seen = scaled[np.concatenate(groups)]
    total = float(np.sum((seen - seen.mean()) ** 2))
    between = sum(len(g) * float(scaled[g].mean() - seen.mean()) ** 2 for g in groups)
    return at, medians, between / total if total > 0 else 0.0
