"""A fit's innovations channel by channel, under the noise that its residuals show."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.identify.fit import Fit, noise_of
from fes_pin.identify.noise import ORDERS, Noise, low_pass, thin, thinning
from fes_pin.identify.problem import Problem

ACTIVATION_S = 0.05
"""Time constant from stimulus to force, s: Dombre, Fournier and Coiffet's ankle, as PAPER_NOTES has it."""


@dataclass(frozen=True)
class Innovations:
    """One channel of one trial.

    Attributes
    ----------
    values
        Shape (n,), of unit variance.
    dt
        Their time step, s.
    """

    trial: Trial
    values: np.ndarray
    dt: float


def under_own_noise(fitted: Fit, longest: int = ORDERS[-1]) -> Fit:
    """The same model, linearized where it is under the noise that its residuals show; `longest` as in `noise_of`."""
    noise = noise_of(fitted, longest)
    parts = Problem(fitted.model, fitted.trials, noise, fitted.free).linearize(fitted.values, fitted.unknowns)
    return replace(fitted, noise=noise, parts=tuple(parts))


def channels(fitted: Fit) -> list[tuple[Noise, list[Innovations]]]:
    """Innovations by channel and time step, with the noise that whitened them."""
    found: dict[tuple[str, float], list[Innovations]] = {}
    for trial, part in zip(fitted.trials, fitted.parts, strict=True):
        at = 0
        for name in fitted.model.rig.outputs(trial.kind):
            if name not in trial.columns or name not in fitted.noise:
                continue
            noise = fitted.noise[name]
            count = thinning(trial.dt, noise.step_s)
            size = max(len(trial) // count - len(noise.ar), 0)
            step = round(trial.dt * count, 9)
            found.setdefault((name, step), []).append(Innovations(trial, part.residual[at : at + size], step))
            at += size
    return [(fitted.noise[name], pieces) for (name, _), pieces in found.items()]


def driven(one: Innovations) -> np.ndarray:
    """Roughly how active the muscle (or the motor, with its sign) is, shape (n,); zero without a stimulus."""
    trial, count = one.trial, max(1, round(one.dt / one.trial.dt))
    drive = next((trial[n] for n in ("pulse_width_us", "stim", "effort") if n in trial.columns), np.zeros(len(trial)))
    pole = float(np.exp(-trial.dt / ACTIVATION_S))
    act = thin(low_pass(drive / max(float(np.abs(drive).max()), 1e-300), pole), count)
    return act[len(act) - len(one.values) :]
