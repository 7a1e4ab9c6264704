"""An ankle on a dynamometer: what it exerts along an imposed motion, by other forms and scipy's integrators."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import betainc

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from imposed_rigs.motion import Motion, drawn, wandering

CAUSES = (
    "recruitment_curvature",
    "threshold_shift",
    "force_length",
    "force_velocity",
    "fatigue",
    "potentiation",
    "second_order_activation",
    "rise_fall_asymmetry",
    "coulomb_friction",
    "quadratic_damping",
    "parallel_stiffness",
    "passive_relaxation",
)
DT, SECONDS, REACH = 0.005, 4.0, 0.35
KNOWN = {
    "foot_mass_kg": 0.12,
    "com_distance_m": 0.08,
    "moment_arm_m": 0.034,
    "force_scale_n": 56.0,
    "threshold_us": 180.0,
    "saturation_us": 1000.0,
    "f0_n": 4.0,
    "f1_per_rad": 2.2,
    "theta_r_rad": 1.3,
}


class Hidden(NamedTuple):
    """What is hidden in an ankle, how large, and the rig's own parameters and forms."""

    causes: tuple[str, ...]
    size: float
    truth: dict[str, float]
    form: dict[str, float]


def study(causes: tuple[str, ...], size: float, rng: np.random.Generator, folder: Path) -> Study:
    """Trials along motions of every speed, two of them nearly still; the stimulus in steps of random width."""
    truth = {
        "gain": rng.uniform(0.5, 0.8),
        "time_constant_s": rng.uniform(0.04, 0.09),
        "inertia_kgm2": rng.uniform(1.0e-3, 2.5e-3),
        "damping_nms": rng.uniform(0.02, 0.08),
    }
    form = {
        "sign": rng.choice([-1.0, 1.0]),
        "centre": rng.uniform(-0.6, 0.6),
        "lag": rng.uniform(0.02, 0.05),
        "relaxation": rng.uniform(0.2, 0.8),
        "share": rng.uniform(0.02, 0.06),
    }
    turned = rng.choice([-1.0, 1.0])  # no convention says which way a dynamometer counts
    trials = tuple(_trial(k, Hidden(causes, size, truth, form), turned, rng) for k in range(8))
    start = {n: float(v * rng.uniform(0.75, 1.3)) for n, v in truth.items()}
    return Study(folder.name, "ankle", KNOWN, start, trials, folder)


def _trial(k: int, hidden: Hidden, turned: float, rng: np.random.Generator) -> Trial:
    time = np.arange(round(SECONDS / DT)) * DT
    reach, slowest = (0.01, 0.3) if k % 4 == 0 else (REACH, 0.2 + 0.1 * k)
    motion = drawn(1.75 + rng.uniform(-0.1, 0.1), reach, slowest, 4.0 * slowest, rng)
    width, at = np.zeros(len(time)), rng.uniform(0.2, 0.5)
    while at < SECONDS:
        lasts, rests = rng.uniform(0.2, 0.8), rng.uniform(0.1, 0.5)
        width[(time >= at) & (time < at + lasts)] = rng.uniform(300.0, 950.0)
        at += lasts + rests * rng.integers(0, 2)
    torque = _torque(time, width, motion, hidden)
    usual = hidden.truth["gain"] * KNOWN["force_scale_n"] * KNOWN["moment_arm_m"]
    read = torque + wandering(len(time), DT, 0.003 * usual, 0.15, rng) + 0.003 * usual * rng.standard_normal(len(time))
    angle = motion.at(time) + 2e-5 * rng.standard_normal(len(time))
    columns = {"pulse_width_us": width, "angle_rad": angle, "torque_nm": turned * read}
    return Trial(f"{k:02d}", "imposed", columns, time)


def _torque(time: np.ndarray, width: np.ndarray, motion: Motion, hidden: Hidden) -> np.ndarray:
    """Eq. (1) of the paper along the motion, with its muscle from an integrator, and what is hidden in it."""
    causes, size, truth, form = hidden
    k, q, v, bend = KNOWN, *(motion.at(time, order) for order in range(3))
    act, tired, ready, relaxed = _states(time, width, motion, hidden)
    usual = truth["gain"] * k["force_scale_n"]
    force, x = usual * act, (q - 0.5 * np.pi) / REACH
    if "force_length" in causes:
        force = force * np.maximum(1.0 - size * (x - form["centre"]) ** 2, 0.05)
    if "force_velocity" in causes:
        speed = 0.25 * size * v / REACH
        force = force * np.where(v > 0.0, (1.0 - speed) / (1.0 + 3.0 * np.abs(speed)), 1.0 + np.tanh(-4.0 * speed) / 2)
    force = force * (1.0 - tired) * (1.0 + ready)
    passive = k["f0_n"] * np.maximum(np.exp(k["f1_per_rad"] * (q - k["theta_r_rad"])) - 1.0, 0.0)
    torque = (k["moment_arm_m"] * force - k["com_distance_m"] * passive) * np.sin(q)
    torque += k["foot_mass_kg"] * 9.81 * k["com_distance_m"] * np.cos(q)
    torque -= truth["damping_nms"] * v + truth["inertia_kgm2"] * bend
    least = 0.3 * size * usual * k["moment_arm_m"]
    if "coulomb_friction" in causes:
        torque -= least * v / np.sqrt(v**2 + (form["share"] * 2.0) ** 2)
    if "quadratic_damping" in causes:
        torque -= least * v * np.abs(v)
    if "parallel_stiffness" in causes:
        torque -= 1.5 * least * np.sinh((q - 1.75 - 0.1 * form["centre"]) / REACH)
    if "passive_relaxation" in causes:
        torque -= 2.0 * least / REACH * (q - relaxed)
    return torque


def _states(time: np.ndarray, width: np.ndarray, motion: Motion, hidden: Hidden) -> np.ndarray:
    """Activation, what is tired, what is potentiated and where a Maxwell element rests, shape (4, n)."""
    causes, size, truth, form = hidden
    shift = form["sign"] * 300.0 * size if "threshold_shift" in causes else 0.0
    r = np.clip((width - shift - KNOWN["threshold_us"]) / (KNOWN["saturation_us"] - KNOWN["threshold_us"]), 0.0, 1.0)
    if "recruitment_curvature" in causes:
        a = 1.0 + 4.0 * size
        r = betainc(a, a, r)  # a sigmoid; its rival of one curvature is another form
    constant, slow = truth["time_constant_s"], np.exp(form["sign"] * 2.0 * size)

    def rates(t: float, x: np.ndarray, drive: float) -> list[float]:
        falls = slow if "rise_fall_asymmetry" in causes and drive < x[0] else 1.0
        act = x[1] if "second_order_activation" in causes else x[0]
        tired = 0.6 * size * max(act, 0.0) * (0.6 - x[2]) - x[2] / 15.0 if "fatigue" in causes else 0.0
        ready = (1.2 * size * act - x[3]) / 1.5 if "potentiation" in causes else 0.0
        rest = (float(motion.at(t)) - x[4]) / form["relaxation"]
        return [(drive - x[0]) / (falls * constant), (x[0] - x[1]) / form["lag"], tired, ready, rest]

    state, states = np.array([0.0, 0.0, 0.0, 0.0, float(motion.at(0.0))]), np.empty((len(time), 5))
    edges = np.unique(np.r_[0, np.flatnonzero(np.diff(r)) + 1, len(time) - 1])
    for a, b in itertools.pairwise(edges):  # the stimulus is constant in between
        run = solve_ivp(rates, (time[a], time[b]), state, "LSODA", time[a : b + 1], args=(r[a],), rtol=1e-7, atol=1e-9)
        states[a : b + 1], state = run.y.T, run.y[:, -1]
    return np.stack([states[:, int("second_order_activation" in causes)], *states.T[2:]])
