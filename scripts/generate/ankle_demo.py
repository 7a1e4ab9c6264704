"""Writes analysis/studies/ankle_demo: an ankle with a hidden cause, from scipy's integrator and the equations alone.

Nothing of the engine is imported: what it is asked to find comes from other code.
"""

import math
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from fes_pin.paper.equation_1 import static_torque_nm

HALF_WIDTH_US = 35.0  # the hidden cause: play in the recruitment
TRUTH = {"gain": 0.74, "time_constant_s": 0.061, "inertia_kgm2": 1.18e-3, "damping_nms": 0.086}
START = {"gain": 0.65, "time_constant_s": 0.05, "inertia_kgm2": 1e-3, "damping_nms": 0.06}
RIG = {
    "foot_mass_kg": 0.118,
    "com_distance_m": 0.078,
    "moment_arm_m": 0.034,
    "force_scale_n": 58.0,
    "threshold_us": 180.0,
    "saturation_us": 1000.0,
}
PASSIVE = {"f0_n": 3.9, "f1_per_rad": 2.25, "theta_r_rad": 1.22}
STEP_S, SECONDS = 0.005, 6.0
NOISE = {"angle_rad": 0.002, "force_n": 0.2}
SEED = 20261

README = """# ankle_demo

A synthetic study with a known answer, for `scripts/demo`, the documentation and the tests. Five motion and two
isometric trials of {seconds:g} s at {rate:g} Hz on the ankle rig, in the study format. Licence: as the repository.

**What is hidden in it:** the recruitment has play, i.e. `recruitment_hysteresis` with `half_width_us = {width:g}`: the
muscle follows the pulse width only after it has moved by that much. Nothing else is wrong with the nominal model.

| parameter | true | start value in study.toml |
|---|---|---|
{table}

White noise: 2 mrad on the angle, 0.2 N on the force. The numbers of `[rig]` are true.

Made by `scripts/make_demo_study` (scripts/generate/ankle_demo.py): the equations of the nominal ankle written out in
numpy, solved by scipy's LSODA at a relative tolerance of 1e-9; no code of the engine that diagnoses it. Seed {seed}.
"""


def stimuli(time: np.ndarray) -> dict[str, np.ndarray]:
    """Pulse widths in us, shape (n,), by name of the trial."""
    t = time / time[-1]
    rng = np.random.default_rng(SEED)
    held = rng.uniform(250.0, 950.0, 12)
    steps = held[np.minimum((time / 0.45).astype(int), 11)]
    stairs = np.array([0, 320, 460, 600, 740, 880, 740, 600, 460, 320, 0, 0])[np.minimum((12 * t).astype(int), 11)]
    triangle = 180.0 + 760.0 * (1.0 - np.abs(2.0 * ((2.0 * t) % 1.0) - 1.0))
    sine = 560.0 + 300.0 * np.sin(2 * np.pi * 0.7 * time) * np.minimum(1.0, time)
    pulses = np.where(time % 1.5 < 0.8, 400.0 + 100.0 * np.floor(time / 1.5), 0.0)
    quiet = (time > 0.3) & (time < SECONDS - 0.5)
    shapes = {"stairs": stairs, "triangle": triangle, "steps": steps, "sine": sine, "pulses": pulses}
    shapes |= {"held_stairs": stairs[::-1], "held_triangle": triangle}
    return {name: np.where(quiet, np.round(shape), 0.0) for name, shape in shapes.items()}


def recruitment(width: np.ndarray) -> np.ndarray:
    """Recruitment of a pulse width that is followed with play, shape (n,)."""
    followed, out = 0.0, np.empty(len(width))
    for k, w in enumerate(width):
        followed = min(max(followed, w - HALF_WIDTH_US), w + HALF_WIDTH_US)
        out[k] = followed
    return np.clip((out - RIG["threshold_us"]) / (RIG["saturation_us"] - RIG["threshold_us"]), 0.0, 1.0)


def activations(r: np.ndarray) -> np.ndarray:
    """Activation at each sample, shape (n,): the exact answer of the lag to a recruitment held between samples."""
    act, keep = np.zeros(len(r)), math.exp(-STEP_S / TRUTH["time_constant_s"])
    for k in range(1, len(r)):
        act[k] = r[k - 1] + (act[k - 1] - r[k - 1]) * keep
    return act


def torque(force: float, angle: float, rate: float, load_kg: float) -> float:
    """Eq. (1)'s right-hand side, N m."""
    return static_torque_nm(RIG | PASSIVE, angle, force, load_kg) - TRUTH["damping_nms"] * rate


def angles(time: np.ndarray, r: np.ndarray, load_kg: float) -> np.ndarray:
    """Angle at each sample, rad, shape (n,), from the static equilibrium on."""
    act, tau = activations(r), TRUTH["time_constant_s"]

    def slope(t: float, x: np.ndarray) -> list[float]:
        k = min(int(t / STEP_S + 1e-9), len(r) - 1)
        now = r[k] + (act[k] - r[k]) * math.exp(-(t - time[k]) / tau)
        force = TRUTH["gain"] * RIG["force_scale_n"] * now
        return [x[1], torque(force, x[0], x[1], load_kg) / TRUTH["inertia_kgm2"]]

    start = brentq(lambda q: torque(0.0, q, 0.0, load_kg), 1.3, 2.6)
    found = solve_ivp(
        slope, (0.0, time[-1]), [start, 0.0], "LSODA", t_eval=time, rtol=1e-9, atol=1e-11, max_step=STEP_S
    )
    return found.y[0]


def toml(trials: list[str]) -> str:
    """study.toml."""

    def lines(table: dict[str, float]) -> str:
        return "\n".join(f"{n} = {v!r}" for n, v in table.items())

    return (
        "# Synthetic: see README.md for what is hidden in it.\n"
        f'[study]\nname = "ankle-demo"\nrig = "ankle"\n\n[rig]\n{lines(RIG)}\n\n[rig.passive]\n{lines(PASSIVE)}\n\n'
        f"[start]\n{lines(START)}\n\n" + "\n".join(trials)
    )


def csv(width: np.ndarray, time: np.ndarray, column: str, values: np.ndarray) -> str:
    """One trial as text."""
    rows = [f"{t:.3f},{w:.0f},{y:.5f}" for t, w, y in zip(time, width, values, strict=True)]
    return "\n".join([f"time_s,pulse_width_us,{column}", *rows, ""])


def main(folder: Path) -> None:
    """Write the study."""
    time = np.round(np.arange(0.0, SECONDS + 0.5 * STEP_S, STEP_S), 3)
    rng = np.random.default_rng(SEED + 1)
    (folder / "trials").mkdir(parents=True, exist_ok=True)
    tables = []
    for k, (name, width) in enumerate(stimuli(time).items()):
        r = recruitment(width)
        if name.startswith("held"):
            column, values = "force_n", TRUTH["gain"] * RIG["force_scale_n"] * activations(r)
            conditions = 'kind = "isometric"\nangle_rad = 1.9\n'
        else:
            load_kg = (1.0, 1.5)[k % 2]
            column, values = "angle_rad", angles(time, r, load_kg)
            conditions = f'kind = "motion"\nload_kg = {load_kg}\n'
        noisy = values + NOISE[column] * rng.standard_normal(len(time))
        (folder / "trials" / f"{name}.csv").write_text(csv(width, time, column, noisy))
        tables.append(f'[[trial]]\nfile = "trials/{name}.csv"\n{conditions}')
    (folder / "study.toml").write_text(toml(tables))
    table = "\n".join(f"| `{n}` | {TRUTH[n]} | {START[n]} |" for n in TRUTH)
    facts = {"seconds": SECONDS, "rate": 1.0 / STEP_S, "width": HALF_WIDTH_US, "seed": SEED, "table": table}
    (folder / "README.md").write_text(README.format(**facts))


if __name__ == "__main__":
    main(Path(__file__).parents[2] / "analysis" / "studies" / "ankle_demo")
