"""The estimator that a user writes in ten lines: regression of a joint's recorded effort on its smoothed motion.

It stands beside the package in docs/accuracy.md: `scripts/accuracy driven --regression`.
"""

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.signal import savgol_filter

import fes_pin as fp

WINDOW_S = 0.08
"""Window of the cubic that smooths the position and the effort, as analysis/servo_pendulum.py takes it or shorter."""
PLAIN = ("coulomb_friction", "effort_offset")
"""Causes that `plain` has without asking whether data show them."""
WINDOWS_S = (0.04, 0.08, 0.16)
"""Windows of which `plain` takes the best."""
PARTS = 4
"""Parts of a single trial that are left out in turn."""
SHARP = 0.05
"""Speed over which friction changes its sign, as a share of the speed's root mean square."""

Columns = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Regressed:
    """Causes by regression, in the order in which they were chosen, with the parameters of both models."""

    causes: tuple[str, ...]
    nominal: dict[str, Any]
    extended: dict[str, Any]

    def to_json(self) -> str:
        """Return the answer in the form of a diagnosis's JSON, as far as the counts read it."""
        causes = [{"name": name, "equivalents": []} for name in self.causes]
        return json.dumps(
            {
                "verdict": "causes_found" if causes else "adequate",
                "causes": causes,
                "remainder": {"unexplained": False},
                "nominal": {"parameters": self.nominal},
                "extended": {"parameters": self.extended},
            }
        )


def regressed(study: fp.Study) -> Regressed:
    """Return the causes that forward selection by the Bayesian information criterion names.

    The rows are decimated to one of each smoothing window, since the criterion takes them for independent.

    Raises
    ------
    ValueError
        The study is not of a joint whose effort and position were recorded.
    """
    if study.rig != "joint" or any("effort" not in trial.columns for trial in study.trials):
        raise ValueError(f"{study.name}: regression is of a joint whose effort was recorded")
    parts = [_trial(study, trial) for trial in study.trials]
    effort, base, others = (
        np.concatenate([part[0] for part in parts]),
        *({name: np.concatenate([part[k][name] for part in parts]) for name in parts[0][k]} for k in (1, 2)),
    )
    chosen: list[str] = []
    fits = [_least_squares(effort, base)]
    while len(chosen) < len(others):
        name, fit = min(
            (
                (n, _least_squares(effort, base | {m: others[m] for m in [*chosen, n]}))
                for n in others.keys() - {*chosen}
            ),
            key=lambda one: one[1][1],
        )
        if fit[1] >= fits[-1][1]:
            break
        chosen.append(name)
        fits.append(fit)
    return Regressed(tuple(chosen), fits[0][0], fits[-1][0])


def plain(study: fp.Study) -> Regressed:
    """Return inertia, damping, dry friction, a constant torque and gravity, with the best of three windows.

    The best one predicts the effort of trials that are left out in turn, or of parts of a single one, smoothed by the
    longest window.
    """
    trials = [trial for trial in study.trials if trial.role != "held_out"]

    def rows(window: float) -> tuple[NDArray[np.float64], Columns, NDArray[np.int64]]:
        parts = [_trial(study, trial, window) for trial in trials]
        columns = [base | {n: others[n] for n in PLAIN} for _, base, others in parts]
        unit = [
            np.full(len(p[0]), k) if len(parts) > 1 else PARTS * np.arange(len(p[0])) // len(p[0])
            for k, p in enumerate(parts)
        ]
        whole = {n: np.concatenate([one[n] for one in columns]) for n in columns[0]}
        return np.concatenate([p[0] for p in parts]), whole, np.concatenate(unit)

    measured, judged, places = rows(WINDOWS_S[-1])

    def missed(window: float) -> float:
        effort, columns, unit = rows(window)
        total = 0.0
        for k in np.unique(unit):
            found, _ = _least_squares(effort[unit != k], {n: x[unit != k] for n, x in columns.items()})
            left = measured - sum(found[n]["value"] * x for n, x in judged.items())
            total += float(np.sum(left[places == k] ** 2))
        return total

    effort, columns, _ = rows(min(WINDOWS_S, key=missed))
    base = {n: x for n, x in columns.items() if n not in PLAIN}
    return Regressed(PLAIN, *(_least_squares(effort, some)[0] for some in (base, columns)))


def _trial(study: fp.Study, trial: fp.Trial, window: float = WINDOW_S) -> tuple[NDArray[np.float64], Columns, Columns]:
    """Return the effort of a trial without known gravity, its nominal columns, and those of causes."""
    length = max(2 * round(0.5 * window / trial.dt) + 1, 5)
    q, v, a = (savgol_filter(trial["position"], length, 3, k, trial.dt)[length::length] for k in range(3))
    effort = savgol_filter(trial["effort"], length, 3)[length::length]
    model = pin.buildModelFromUrdf(str(study.files["urdf"]))
    data = model.createData()
    zero = pin.neutral(model)  # a joint without limits has a cosine and a sine as its position
    at = (pin.integrate(model, zero, np.array([x])) for x in q)
    gravity = np.array([pin.computeGeneralizedGravity(model, data, one)[0] for one in at])
    base = {"inertia_scale": pin.crba(model, data, zero)[0, 0] * a, "damping": v}
    if "gravity_scale" in study.constants:
        effort = effort - study.constants["gravity_scale"] * gravity
    else:
        base["gravity_scale"] = gravity
    usual = np.sqrt(np.mean(v**2))
    return (
        effort,
        base,
        {
            "coulomb_friction": np.tanh(v / (SHARP * usual)),
            "quadratic_damping": v * np.abs(v),
            "effort_offset": -np.ones_like(v),
            "parallel_stiffness": q,
        },
    )


def _least_squares(effort: NDArray[np.float64], columns: Columns) -> tuple[dict[str, Any], float]:
    """Return estimates with their deviations, as a diagnosis's JSON has them, and the criterion."""
    design = np.column_stack(list(columns.values()))
    values, *_ = np.linalg.lstsq(design, effort, rcond=None)
    residual = effort - design @ values
    count, free = design.shape
    variance = residual @ residual / (count - free)
    std = np.sqrt(variance * np.diag(np.linalg.pinv(design.T @ design)))
    found = {n: {"value": float(x), "std": float(s)} for n, x, s in zip(columns, values, std, strict=True)}
    return found, count * np.log(residual @ residual / count) + free * np.log(count)
