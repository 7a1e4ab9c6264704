"""Simulation and fits against scipy, in one run on one machine.

.venv/bin/python scripts/benchmarks/show.py engine
"""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import scipy.integrate
import scipy.optimize

from fes_pin.data.study import read_study
from fes_pin.data.trial import Trial
from fes_pin.models.compile.layout import WIDE, WIDTH
from fes_pin.models.model import Model
from fes_pin.models.rigs import Ankle
from fes_pin.models.simulate import Simulator
from fes_pin.paper.equation_1 import static_torque_nm
from fes_pin.search.fit import fit

KNOWN = {
    "foot_mass_kg": 0.12,
    "com_distance_m": 0.08,
    "moment_arm_m": 0.034,
    "force_scale_n": 60.0,
    "threshold_us": 180.0,
    "saturation_us": 1000.0,
    "f0_n": 4.0,
    "f1_per_rad": 2.2,
    "theta_r_rad": 1.2,
}
TRUE = {"gain": 0.65, "time_constant_s": 0.05, "inertia_kgm2": 1e-3, "damping_nms": 0.0585}
START = {"gain": 0.5, "time_constant_s": 0.07, "inertia_kgm2": 1.3e-3, "damping_nms": 0.08}
Row = tuple[str, float, float | None, str]


def run() -> list[Row]:
    """Rows of (name, measured, target, unit)."""
    return [*_simulation(), *_fits(), *_cold()]


def _trial(seconds: float, rate: float, seed: int = 0) -> Trial:
    rng = np.random.default_rng(seed)
    time_ = np.arange(0.0, seconds, 1.0 / rate)
    levels = np.where(rng.random(20) < 0.3, 0.0, rng.uniform(200.0, 1000.0, 20))
    width = np.repeat(levels, -(-len(time_) // 20))[: len(time_)]
    return Trial("bench", "motion", {"pulse_width_us": width}, time_, {"load_kg": 1.0})


def _rates(t: float, x: np.ndarray, r: float, p: dict[str, float]) -> list[float]:
    """Eq. (1) in plain Python, as one would write it for solve_ivp."""
    act, q, v = x
    force = p["gain"] * p["force_scale_n"] * act
    torque = static_torque_nm(p, q, force, p["load_kg"]) - p["damping_nms"] * v
    return [(r - act) / p["time_constant_s"], v, torque / p["inertia_kgm2"]]


def _scipy(trial: Trial, p: dict[str, float], **how: float | str) -> np.ndarray:
    """The angle by solve_ivp, restarted where the pulse width jumps."""
    p = {**p, "load_kg": trial.conditions["load_kg"]}
    r = np.clip((trial["pulse_width_us"] - p["threshold_us"]) / (p["saturation_us"] - p["threshold_us"]), 0.0, 1.0)
    rest = scipy.optimize.brentq(lambda q: _rates(0.0, np.array([0.0, q, 0.0]), 0.0, p)[2], 0.5, 3.0, xtol=1e-14)
    x, angle = np.array([0.0, rest, 0.0]), np.empty(len(trial))
    edges = np.r_[0, np.flatnonzero(np.diff(r)) + 1, len(r)]
    for a, b in itertools.pairwise(edges):
        end = trial.time[0] + b * trial.dt
        at = np.minimum(np.r_[trial.time[a:b], end], end)
        done = scipy.integrate.solve_ivp(_rates, (at[0], end), x, t_eval=at, args=(r[a], p), **how)
        angle[a:b], x = done.y[1, :-1], done.y[:, -1]
    return angle


def _times(function, times: int) -> list[float]:
    took = []
    for _ in range(times):
        began = time.perf_counter()
        function()
        took.append(time.perf_counter() - began)
    return took


def _median(function, times: int) -> float:
    return float(np.median(_times(function, times)))


def _medians(ours, theirs, turns: int = 7, times: int = 60) -> tuple[float, float]:
    """Times of both, measured alternately, so that a slow machine slows both."""
    pairs = [(_times(ours, times), _times(theirs, 1)) for _ in range(turns)]
    return float(np.median([p[0] for p in pairs])), float(np.median([p[1] for p in pairs]))


def _simulation() -> list[Row]:
    trial, model = _trial(10.0, 1000.0), Model(Ankle(constants=KNOWN, **TRUE))
    simulator = Simulator(model, [trial])
    angle = simulator.run(TRUE)[0].readings[:, 0]
    exact = _scipy(trial, KNOWN | TRUE, method="DOP853", rtol=1e-12, atol=1e-13)
    ours, theirs = _medians(lambda: simulator.run(TRUE), lambda: _scipy(trial, KNOWN | TRUE, method="LSODA", rtol=1e-6))
    four, eight = (Simulator(model, [trial] * count) for count in (WIDTH, WIDE))
    packed, wide = (_median(lambda s=s: s.run(TRUE), 31) / len(s.trials) for s in (four, eight))
    bent = Simulator(model, [trial] * WIDTH, tuple(TRUE))
    sensitive = _median(lambda: bent.run(TRUE), 31) / WIDTH
    return [
        ("one simulation, 10 s at 1 kHz, alone in its block of lanes", 1e3 * ours, None, "ms"),
        (f"one of {WIDTH} that fill a block", 1e3 * packed, None, "ms"),
        (f"one of {WIDE} that fill a wide one", 1e3 * wide, None, "ms"),
        (f"one of {WIDTH}, with sensitivities to 4 parameters", 1e3 * sensitive, None, "ms"),
        ("times faster than solve_ivp LSODA, rtol 1e-6", theirs / ours, 50.0, "x"),
        ("largest angle error", float(np.abs(angle - exact).max()), 1e-6, "rad"),
    ]


def _motions() -> tuple[str, dict[str, float], dict[str, float], list[Trial]]:
    """A practice study's motion trials, or eight of our own: name, constants, start values, trials."""
    shared = Path(os.environ.get("FES_PIN_DATA") or Path(__file__).parents[3] / "shared")
    if (shared / "practice" / "n00_none").is_dir():
        study = read_study(shared / "practice" / "n00_none")
        motions = [t for t in study.trials if t.kind == "motion"]
        return study.name, dict(study.constants), dict(study.start), motions
    rng, trials = np.random.default_rng(1), []
    for k in range(8):
        bare = _trial(8.0, 200.0, seed=k)
        angle = _scipy(bare, KNOWN | TRUE, method="LSODA", rtol=1e-8, atol=1e-10)
        trials.append(bare.with_columns(angle_rad=angle + 0.002 * rng.standard_normal(len(bare))))
    return "eight trials", KNOWN, START, trials


def _fits() -> list[Row]:
    name, known, start, trials = _motions()
    model = Model(Ankle(constants=known, **start))
    fit(model, trials, least_squares=True)
    ours = _median(lambda: fit(model, trials, least_squares=True), 7)
    names = list(start)

    def residual(x: np.ndarray) -> np.ndarray:
        p = {**known, **dict(zip(names, x, strict=True))}
        return np.concatenate([t["angle_rad"] - _scipy(t, p, method="LSODA", rtol=1e-6) for t in trials])

    began = time.perf_counter()
    found = scipy.optimize.least_squares(residual, list(start.values()), x_scale=list(start.values()), diff_step=1e-4)
    theirs = time.perf_counter() - began
    mine = fit(model, trials, least_squares=True).values
    apart = max(abs(found.x[k] / mine[n] - 1.0) for k, n in enumerate(names))
    return [
        (f"fit of the nominal ankle to {name} ({len(trials)} motion trials)", 1e3 * ours, None, "ms"),
        ("times faster than solve_ivp + least_squares", theirs / ours, 300.0, "x"),
        ("largest relative difference of the two fits' parameters", apart, None, "1"),
    ]


def _cold() -> list[Row]:
    command = str(Path(sys.executable).parent / "fes-pin")
    took = _median(lambda: subprocess.run([command, "--help"], capture_output=True, check=True), 5)
    return [("fes-pin --help", took, 0.5, "s")]
