"""The fit that a user writes in ten lines: the motion by `solve_ivp`, the parameters by `least_squares`.

It stands beside the package: `scripts/accuracy large --ten-lines`. Of a joint it fits the inertia's scale, damping, a
constant torque and dry friction (gravity's scale where the study does) and where each trial begins; of a muscle
strength, time constant, resting force and delay.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin
from large_rigs.recorded import changes
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares
from scipy.signal import lfilter, savgol_filter

import fes_pin as fp
from fes_pin.models.rigs import pulse_period

SHARP = 0.01
"""Speed over which friction changes its sign, as a share of the speed's root mean square."""
SCALES = (0.4, 0.55, 0.75, 1.0, 1.35, 1.8, 2.5)
"""Inertia that is tried first, as a multiple of the stated one, each with dampings and frictions."""
BEST = 3
"""Starts that are followed to the end."""
STEP = 1e-5
"""Of differences, as a share of a parameter."""
NAMED = 3.0
"""A cause is named whose size is so many of its deviations."""
CAUSES = {
    "offset": "effort_offset",
    "friction": "coulomb_friction",
    "rest": "sensor_offset",
    "delay": "electromechanical_delay",
}


@dataclass(frozen=True)
class Solved:
    """A fit: values and deviations by name, and what predicts a trial."""

    values: Mapping[str, float]
    std: Mapping[str, float]
    predicted: Callable[[fp.Trial], np.ndarray]

    def to_json(self) -> str:
        """Return the answer in the form of a diagnosis's JSON, as far as the counts read it."""
        causes = [CAUSES[n] for n in self.values if n in CAUSES and abs(self.values[n]) > NAMED * self.std[n]]
        found = {n: {"value": v, "std": self.std[n]} for n, v in self.values.items() if n not in CAUSES}
        return json.dumps(
            {
                "verdict": "causes_found" if causes else "adequate",
                "causes": [{"name": name, "equivalents": []} for name in causes],
                "remainder": {"unexplained": False},
                "extended": {"parameters": found},
            }
        )


def solved(study: fp.Study) -> Solved:
    """Return the fit of a joint's motion or of a muscle's force.

    Raises
    ------
    ValueError
        The study is of another rig, of groups of trials, or of an imposed motion.
    """
    fits = {"joint": _joint, "muscle": _muscle}
    imposed = any(t.kind == "imposed" for t in study.trials)
    if study.rig not in fits or imposed or any(t.group for t in study.trials):
        raise ValueError(f"{study.name}: ten lines are of joints that move and muscles that are held, without groups")
    return fits[study.rig](study)


def _muscle(study: fp.Study) -> Solved:
    period = pulse_period([t for t in study.trials if "stim" in t.columns])

    def force(x: Sequence[float], trial: fp.Trial) -> np.ndarray:
        gain, tau, rest, delay = x
        known = study.constants
        if "stim" in trial.columns:
            drive = trial["stim"] * period / trial.dt
        else:
            low = known["threshold_us"]
            drive = np.clip((trial["pulse_width_us"] - low) / (known["saturation_us"] - low), 0.0, 1.0)
        keep = np.exp(-trial.dt / tau)
        act = lfilter([0.0, 1.0 - keep], [1.0, -keep], drive)
        return rest + gain * np.interp(trial.time - delay, trial.time, act, left=0.0)

    def missed(x: Sequence[float]) -> np.ndarray:
        return np.concatenate([t["force_n"] - force(x, t) for t in study.trials])

    first = np.median([t["force_n"][0] for t in study.trials])
    gain, tau = study.start["gain"], study.start["time_constant_s"]
    starts = [(g * gain, s * tau, first, d) for g in (0.5, 1.0, 2.0) for s in (0.5, 1.0, 2.0) for d in (0.0, 0.01)]
    best = sorted(starts, key=lambda x: float(np.sum(missed(x) ** 2)))[:BEST]
    bounds = ([0.0, 1e-4, -np.inf, 0.0], [np.inf, 2.0, np.inf, 0.2])
    fits = [least_squares(missed, x, x_scale=(gain, tau, gain, 0.01), bounds=bounds) for x in best]
    fit = min(fits, key=lambda one: one.cost)
    names = ("gain", "time_constant_s", "rest", "delay")
    return Solved(*_estimates(names, fit.x, fit.jac, fit.fun), lambda trial: force(fit.x, trial))


def _estimates(names: Sequence[str], x: np.ndarray, jac: np.ndarray, missed: np.ndarray) -> tuple[dict, dict]:
    """Return values and deviations of the first parameters, by name."""
    variance = missed @ missed / max(len(missed) - len(x), 1)
    std = np.sqrt(variance * np.maximum(np.diag(np.linalg.pinv(jac.T @ jac)), 0.0))
    return {n: float(v) for n, v in zip(names, x, strict=False)}, {
        n: float(s) for n, s in zip(names, std, strict=False)
    }


@dataclass(frozen=True)
class _Equation:
    """A joint's equation of motion, for parameters side by side.

    Attributes
    ----------
    names
        Of the parameters.
    known
        Values of those that are not fitted.
    inertia, weight
        Of the URDF: kg m2, and gravity's torque `weight[0] cos(q) + weight[1] sin(q)`, N m; both constant for a slide.
    speed
        Over which friction changes its sign.
    """

    names: tuple[str, ...]
    known: Mapping[str, float]
    inertia: float
    weight: tuple[float, float]
    turns: float
    speed: float

    def run(self, x: np.ndarray, trial: fp.Trial, start: np.ndarray) -> np.ndarray:
        """Return positions, shape (n, columns), of parameters (names, columns) from states (2, columns)."""
        p = {**self.known, **dict(zip(self.names, x, strict=True))}

        def rates(t: float, state: np.ndarray, effort: float) -> np.ndarray:
            q, v = state.reshape(2, -1)
            pull = self.weight[0] * np.cos(self.turns * q) + self.weight[1] * np.sin(self.turns * q)
            torque = effort + p["offset"] - p["gravity_scale"] * pull - p["damping"] * v
            torque = torque - p["friction"] * np.tanh(v / self.speed)
            return np.concatenate([v, torque / (p["inertia_scale"] * self.inertia)])

        time, state = trial.time, start.ravel()
        effort = trial["effort"] if "effort" in trial.columns else np.zeros(len(time))
        at = [*np.searchsorted(time, changes(effort, time)[0]), len(time) - 1]
        out = np.empty((len(time), start.shape[1]))
        out[0] = start[0]
        for a, b in pairwise(at):
            if a < b:
                span = (time[a], time[b])
                one = solve_ivp(rates, span, state, t_eval=time[a : b + 1], args=(effort[a],), rtol=1e-7, atol=1e-9)
                out[a : b + 1], state = one.y.T[:, : start.shape[1]], one.y[:, -1]
        return out


def _joint(study: fp.Study) -> Solved:
    equation = _equation(study)
    names, trials = equation.names, study.trials
    begun = [_begun(t) for t in trials]
    scale = _sizes(study, equation)
    floor = np.concatenate(
        [scale, *([np.ptp(t["position"]), abs(b[1]) + 1.0] for t, b in zip(trials, begun, strict=True))]
    )

    def split(x: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
        return x[: len(names)], x[len(names) + 2 * k : len(names) + 2 * k + 2]

    def missed(x: np.ndarray) -> np.ndarray:
        runs = (equation.run(split(x, k)[0][:, None], t, split(x, k)[1][:, None]) for k, t in enumerate(trials))
        return np.concatenate([run[:, 0] - t["position"] for run, t in zip(runs, trials, strict=True)])

    def slopes(x: np.ndarray) -> np.ndarray:
        step = STEP * np.maximum(np.abs(x), 0.1 * floor)
        out = []
        for k, trial in enumerate(trials):
            own = [*range(len(names)), len(names) + 2 * k, len(names) + 2 * k + 1]
            many = np.repeat(x[:, None], 2 * len(own), axis=1)
            for column, i in enumerate(own):
                many[i, column] += step[i]
                many[i, column + len(own)] -= step[i]
            run = equation.run(*split(many, k)[:1], trial, split(many, k)[1])
            jac = np.zeros((len(trial), len(x)))
            jac[:, own] = (run[:, : len(own)] - run[:, len(own) :]) / (2.0 * step[own])
            out.append(jac)
        return np.concatenate(out)

    grid = _grid(equation, study, scale)
    costs = sum(
        np.sum(
            (equation.run(grid, t, np.repeat(np.array(b)[:, None], grid.shape[1], 1)) - t["position"][:, None]) ** 2, 0
        )
        for t, b in zip(trials, begun, strict=True)
    )
    low = [1e-2 if n == "inertia_scale" else 0.0 if n in ("damping", "friction") else -np.inf for n in names]
    bounds = (np.append(low, np.full(2 * len(trials), -np.inf)), np.inf)
    fits = []
    for k in np.argsort(np.where(np.isfinite(costs), costs, np.inf))[:BEST]:
        x = np.concatenate([grid[:, k], *begun])
        fits.append(least_squares(missed, x, slopes, bounds, x_scale=floor, max_nfev=60))
    fit = min(fits, key=lambda one: one.cost)

    def predicted(trial: fp.Trial) -> np.ndarray:
        return equation.run(fit.x[: len(names), None], trial, np.array(_begun(trial))[:, None])[:, 0]

    return Solved(*_estimates(names, fit.x, fit.jac, fit.fun), predicted)


def _begun(trial: fp.Trial) -> tuple[float, float]:
    """Return position and speed at the first sample, as they are stated, else by a parabola through 0.1 s."""
    count = max(6, round(0.1 / trial.dt))
    slope, value = np.polynomial.polynomial.polyfit(trial.time[:count] - trial.time[0], trial["position"][:count], 2)[
        1::-1
    ]
    return trial.conditions.get("position0", float(value)), trial.conditions.get("velocity0", float(slope))


def _equation(study: fp.Study) -> _Equation:
    model = pin.buildModelFromUrdf(str(study.files["urdf"]))
    data, q = model.createData(), pin.neutral(model)
    turns = 0.0 if "P" in model.joints[1].shortname().removeprefix("JointModel")[:2] else 1.0
    along = pin.computeGeneralizedGravity(model, data, q)[0]
    across = pin.computeGeneralizedGravity(model, data, pin.integrate(model, q, np.full(1, 0.5 * np.pi)))[0] * turns
    inertia = pin.crba(model, data, q)[0, 0]
    speed = np.sqrt(np.mean(np.concatenate([np.gradient(_smooth(t), t.dt) ** 2 for t in study.trials])))
    known = {"gravity_scale": 1.0, **study.constants}
    fitted = [n for n in study.start if n in ("inertia_scale", "damping", "gravity_scale")]
    free = all("effort" not in t.columns for t in study.trials)
    if free and ("gravity_scale" in fitted or not (along or across)):  # which shows ratios alone
        fitted.remove("inertia_scale")
        known["inertia_scale"] = 1.0
    return _Equation((*fitted, "offset", "friction"), known, inertia, (along, across), turns, SHARP * speed)


def _smooth(trial: fp.Trial) -> np.ndarray:
    """Return positions that a cubic has smoothed over 0.1 s."""
    length = min(max(2 * round(0.05 / trial.dt) + 1, 5), len(trial) // 2 * 2 - 1)
    return np.asarray(savgol_filter(trial["position"], length, 3))


def _sizes(study: fp.Study, equation: _Equation) -> np.ndarray:
    """Return the size of each parameter."""
    speeds = equation.speed / SHARP
    torque = max(np.hypot(*equation.weight), *(np.abs(t["effort"]).max() for t in study.trials if "effort" in t), 0.0)
    torque = torque or study.start["damping"] * speeds
    known = {"inertia_scale": 1.0, "gravity_scale": 1.0, "damping": torque / speeds}
    return np.array([known.get(n, torque) for n in equation.names])


def _grid(equation: _Equation, study: fp.Study, scale: np.ndarray) -> np.ndarray:
    """Return parameters to start from, shape (names, starts)."""
    size = dict(zip(equation.names, scale, strict=True))
    values = {
        "inertia_scale": [s * study.start["inertia_scale"] for s in SCALES],
        "gravity_scale": [0.5, 0.7, 1.0, 1.4, 2.0],
        "damping": [size["damping"] * s for s in (0.02, 0.2)],
        "offset": [size["offset"] * s for s in (-0.3, 0.0, 0.3)],
        "friction": [size["friction"] * s for s in (0.0, 0.2)],
    }
    every = np.meshgrid(*(values[n] for n in equation.names), indexing="ij")
    return np.stack([one.ravel() for one in every])
