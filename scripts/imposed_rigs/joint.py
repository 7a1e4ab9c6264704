"""A joint on a test stand: the effort that an imposed motion takes, by other forms and another integrator."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from driven_rigs.draw import URDF
from scipy.integrate import solve_ivp

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from imposed_rigs.motion import Motion, drawn, wandering

CAUSES = (
    "coulomb_friction",
    "quadratic_damping",
    "effort_offset",
    "parallel_stiffness",
    "joint_stop",
    "passive_relaxation",
    "cogging",
    "effort_gain",
    "sensor_lag",
    "mains_hum",
)
DT, SECONDS = 0.002, 5.0


def study(
    causes: tuple[str, ...],
    size: float,
    rng: np.random.Generator,
    folder: Path,
    moved: Callable[..., Motion] = drawn,
    seconds: float = SECONDS,
) -> Study:
    """A hanging arm, moved by a stand; each cause acts with about `size` of the effort that it takes without.

    Its gravity is known, as with any arm that was weighed.

    Parameters
    ----------
    moved
        Draws a motion, as `drawn` does.
    seconds
        Length of a trial, s.
    """
    mass, about, damping = rng.uniform(0.5, 3.0), rng.uniform(0.01, 0.05), rng.uniform(0.05, 0.3)
    inertia, weight = about + mass * 0.04, 9.81 * mass * 0.2
    time = np.arange(round(seconds / DT)) * DT
    motions = [moved(rng.uniform(-0.2, 0.2), rng.uniform(0.4, 0.9), 0.2, 1.2, rng) for _ in range(5)]
    bare = [inertia * m.at(time, 2) + damping * m.at(time, 1) + weight * np.sin(m.at(time)) for m in motions]
    usual = float(np.sqrt(np.mean(np.square(bare))))
    speed = float(np.sqrt(np.mean([np.square(m.at(time, 1)) for m in motions])))
    reach = max(float(np.abs(m.at(time)).max()) for m in motions)
    form = {"share": rng.uniform(0.02, 0.06), "rest": rng.uniform(-0.3, 0.3) * reach, "waves": rng.uniform(6.0, 12.0)}
    form |= {"relaxation": rng.uniform(0.2, 0.6), "lag": rng.uniform(0.01, 0.03), "sign": rng.choice([-1.0, 1.0])}
    noise = usual * rng.uniform(0.002, 0.01), usual * rng.uniform(0.0, 0.02), reach * rng.choice([1e-5, 1e-4])
    trials = []
    for k, (motion, effort) in enumerate(zip(motions, bare, strict=True)):
        total = effort + _hidden(causes, size * usual, motion, time, speed, reach, form)
        total += wandering(len(time), DT, noise[1], 0.2, rng)
        if "effort_gain" in causes:
            total = total / (1.0 + form["sign"] * size)
        if "sensor_lag" in causes:
            total = _lagged(time, total, form["lag"])
        read = total + noise[0] * rng.standard_normal(len(time))
        position = motion.at(time) + noise[2] * rng.standard_normal(len(time))
        trials.append(Trial(f"{k:02d}", "imposed", {"position": position, "effort": read}, time))
    folder.mkdir(parents=True, exist_ok=True)
    shape = {"lever": "0 0 -0.2", "mass": mass, "about": about, "kind": "revolute", "axis": "0 1 0"}
    (folder / "rig.urdf").write_text(URDF.format(name="rig", **shape))
    start = {"inertia_scale": float(rng.uniform(0.8, 1.25)), "damping": damping * float(rng.uniform(0.5, 1.5))}
    return Study(
        folder.name, "joint", {"gravity_scale": 1.0}, start, tuple(trials), folder, {"urdf": folder / "rig.urdf"}
    )


def _hidden(
    causes: tuple[str, ...],
    size: float,
    motion: Motion,
    time: np.ndarray,
    speed: float,
    reach: float,
    form: dict[str, float],
) -> np.ndarray:
    """Effort that what is hidden takes besides."""
    q, v, out = motion.at(time), motion.at(time, 1), np.zeros(len(time))
    if "coulomb_friction" in causes:
        out += size * v / np.sqrt(v**2 + (form["share"] * speed) ** 2)
    if "quadratic_damping" in causes:
        out += size * v * np.abs(v) / speed**2
    if "effort_offset" in causes:
        out += form["sign"] * size
    if "parallel_stiffness" in causes:
        x = (q - form["rest"]) / reach
        out += 1.5 * size * np.sinh(x)
    if "joint_stop" in causes:
        out += 8.0 * size / reach * np.maximum(q - 0.6 * reach, 0.0) * (1.0 + 0.1 * v)
    if "passive_relaxation" in causes:
        stiffness, constant = 2.0 * size / reach, form["relaxation"]
        run = solve_ivp(
            lambda t, y: (motion.at(t) - y) / constant,
            (time[0], time[-1]),
            [q[0]],
            "DOP853",
            time,
            rtol=1e-8,
            atol=1e-9,
        )
        out += stiffness * (q - run.y[0])
    if "cogging" in causes:
        out += size * np.sin(form["waves"] / reach * q + 0.4)
    if "mains_hum" in causes:
        out += 0.3 * size * np.sin(2.0 * np.pi * 50.0 * time + 0.7)
    return out


def _lagged(time: np.ndarray, values: np.ndarray, constant: float) -> np.ndarray:
    """A second-order low pass of the same delay, as filters of amplifiers are."""
    half = 0.5 * constant
    run = solve_ivp(
        lambda t, y: [(np.interp(t, time, values) - y[0]) / half, (y[0] - y[1]) / half],
        (time[0], time[-1]),
        [values[0], values[0]],
        "RK45",
        time,
        rtol=1e-6,
        atol=1e-6 * float(np.abs(values).max()),
        max_step=2.0 * DT,
    )
    return run.y[1]
