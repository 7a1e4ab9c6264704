"""A muscle on a lever: a Hill-type muscle by scipy's integrators, with what is believed of it left out."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from imposed_rigs.motion import drawn, wandering

CAUSES = (
    "force_length",
    "force_velocity",
    "series_elasticity",
    "parallel_stiffness",
    "pulse_summation",
    "length_dependent_activation",
    "residual_force_enhancement",
    "fatigue",
    "potentiation",
    "second_order_activation",
)
DT, SECONDS, RATE_HZ = 0.002, 3.0, 50.0
LENGTH_M, WAY_M, FORCE_N = 0.05, 0.005, 20.0


def study(causes: tuple[str, ...], size: float, rng: np.random.Generator, folder: Path) -> Study:
    """Trains of pulses while a lever stretches and shortens the muscle, or holds it.

    Of a muscle with a tendon the force depends on velocity as well: without that a tendon shows nothing.
    """
    constant = rng.uniform(0.03, 0.06)
    if "series_elasticity" in causes:
        causes = (*causes, "force_velocity")
    form = {
        "slope": rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.0),
        "vmax": rng.uniform(0.08, 0.15) / (2.0 * size),
        "compliance": rng.uniform(1.0, 2.0) * 1e-4,
        "power": rng.choice([1.7, 2.2]),
        "tau2": rng.uniform(0.01, 0.03),
    }
    trials = tuple(_trial(k, causes, size, constant, form, rng) for k in range(8))
    start = {"gain": FORCE_N * float(rng.uniform(0.7, 1.3)), "time_constant_s": constant * float(rng.uniform(0.7, 1.3))}
    return Study(folder.name, "muscle", {}, start, trials, folder)


def _trial(
    k: int, causes: tuple[str, ...], size: float, constant: float, form: dict[str, float], rng: np.random.Generator
) -> Trial:
    time = np.arange(round(SECONDS / DT)) * DT
    motion = drawn(LENGTH_M + rng.uniform(-0.4, 0.4) * WAY_M, WAY_M * (0.02 if k % 4 == 0 else 0.6), 0.4, 3.0, rng)
    begin, on, pause = rng.uniform(0.1, 0.3), rng.uniform(0.2, 0.6), rng.uniform(0.3, 0.5)
    stimulated = (time > begin) & ((time - begin) % (on + pause) < on)
    stim = np.where(stimulated & (np.arange(len(time)) % round(1.0 / (RATE_HZ * DT)) == 0), 1.0, 0.0)
    force = _force(time, stim, motion, causes, size, constant, form)
    read = (
        force + wandering(len(time), DT, 0.002 * FORCE_N, 0.1, rng) + 0.003 * FORCE_N * rng.standard_normal(len(time))
    )
    length = motion.at(time) + 2e-6 * rng.standard_normal(len(time))
    return Trial(f"{k:02d}", "imposed", {"stim": stim, "length_m": length, "force_n": read}, time)


def _force(time, stim, motion, causes, size, constant, form):  # type: ignore[no-untyped-def]
    """Force of the muscle: activation, second lag, history and tendon as one system for LSODA."""
    area = 1.0 / (RATE_HZ * DT)
    state, out = np.zeros(6), np.empty(len(time))  # act, second lag, tired, potentiated, stretched, tendon

    def isometric(x: np.ndarray, length: float) -> float:
        act = x[1] if "second_order_activation" in causes else x[0]
        z = (length - LENGTH_M) / WAY_M
        if "length_dependent_activation" in causes:
            act = max(act, 0.0) ** np.exp(-1.5 * size * form["slope"] * z)
        if "pulse_summation" in causes:
            c = max(act, 0.0) ** form["power"]
            act = c * (1.0 + 1.0) / (1.0 + c)
        force = FORCE_N * act
        if "force_length" in causes:
            force *= max(1.0 - 2.0 * size * (z - form["slope"] * 0.6) ** 2, 0.05) / (1.0 - 2.0 * size * 0.36)
        return force * (1.0 - x[2]) * (1.0 + x[3]) * (1.0 + x[4])

    def speed_factor(u: float) -> float:
        v = u / form["vmax"]
        return (1.0 - v) / (1.0 + 4.0 * v) if v > 0 else 1.5 - 0.5 * (1.0 + v) / (1.0 - 9.0 * v)

    def speed_of(share: float) -> float:
        share = min(max(share, -0.2), 1.45)
        if share < 1.0:
            return form["vmax"] * (1.0 - share) / (1.0 + 4.0 * share)
        lift = 2.0 * (1.5 - share)  # (1 + v) / (1 - 9 v)
        return form["vmax"] * (lift - 1.0) / (1.0 + 9.0 * lift)

    def rates(t: float, x: np.ndarray, drive: float) -> np.ndarray:
        act, stretch = x[0], float(motion.at(t, 1))
        tired = size * 0.8 * act * (0.65 - x[2]) - x[2] / 20.0 if "fatigue" in causes else 0.0
        ready = (size * 1.2 * act - x[3]) / 1.0 if "potentiation" in causes else 0.0
        kept = (
            size / WAY_M * act * max(stretch, 0.0) - max(1.0 - act, 0.0) * x[4] / 0.08
            if "residual_force_enhancement" in causes
            else 0.0
        )
        pull = 0.0
        if "series_elasticity" in causes:
            capacity = max(isometric(x, float(motion.at(t)) - form["compliance"] * x[5]), 0.01)
            pull = (stretch + speed_of(x[5] / capacity)) / form["compliance"]
        return np.array([(drive - act) / constant, (act - x[1]) / form["tau2"], tired, ready, kept, pull])

    states = np.empty((len(time), 6))
    edges = np.unique(np.r_[0, np.flatnonzero(np.diff(stim)) + 1, len(time) - 1])
    for a, b in itertools.pairwise(edges):  # the drive is constant in between
        run = solve_ivp(
            rates, (time[a], time[b]), state, "LSODA", time[a : b + 1], args=(area * stim[a],), rtol=1e-6, atol=1e-8
        )
        states[a : b + 1], state = run.y.T, run.y[:, -1]
    for k, t in enumerate(time):
        length, stretch, state = float(motion.at(t)), float(motion.at(t, 1)), states[k]
        if "series_elasticity" in causes:
            out[k] = state[5]
        else:
            out[k] = isometric(state, length) * (speed_factor(-stretch) if "force_velocity" in causes else 1.0)
        if "parallel_stiffness" in causes:
            beyond = max((length - LENGTH_M) / WAY_M + 0.2, 0.0)
            out[k] += 0.8 * size * FORCE_N * (np.exp(3.0 * beyond) - 1.0) / (np.exp(3.0) - 1.0)
    return out
