"""Arms whose recorded effort has another zero, or another scale, in each trial, or neither."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
from driven_rigs import draw
from imposed_rigs import joint as stand
from scipy.integrate import solve_ivp

import fes_pin as fp
from fes_pin.data.trial import Trial
from harness.generator import Item, Truth

ZERO, SCALE = "zero_by_trial", "scale_by_trial"
ZEROS = (0.05, 0.25)
"""Root mean square of the zeros, as a share of the effort's."""
SCALES = (0.8, 1.25)
SIZE = 0.15
"""Torque of what is hidden, as a share of the effort."""
ROWS = ("free", "driven", "imposed", "free")
"""How the arm is moved, in turn: by a recorded effort alone, by a controller, or along an imposed motion."""
CAUSES = ((), ("coulomb_friction",), ("passive_relaxation",), ("quadratic_damping",), ("parallel_stiffness",))
DT = 0.01


class ByTrial:
    """A zero by trial, a scale by trial, and two studies without either, in turn; one more cause, or none."""

    ask = staticmethod(fp.diagnose)

    def plan(self, seed: int) -> Iterator[Item]:
        for k in count(seed):
            rng = np.random.default_rng([k, 3])
            cause = CAUSES[int(rng.integers(len(CAUSES)))]
            fault = ((ZERO,), (SCALE,), (), ())[k % 4]
            kind = ROWS[k // 4 % len(ROWS)]
            yield Item(f"{kind}-{k}", k, (*fault, *cause), kind)

    def make(self, item: Item, folder: Path) -> tuple[fp.Study, Truth]:
        rng = np.random.default_rng([item.seed, 5])
        causes = tuple(c for c in item.hidden if c not in (ZERO, SCALE))
        if item.part == "driven":
            made = fp.read_study(draw.draw(causes, 2.0 * SIZE, item.seed, folder).study)
        elif item.part == "imposed":
            made = stand.study(causes, 2.0 * SIZE, rng, folder / "study")
        else:
            made = free(causes, rng, folder / "study")
        usual = float(np.sqrt(np.mean([np.mean(t["effort"] ** 2) for t in made.trials])))
        zeros, scales = np.zeros(len(made.trials)), np.ones(len(made.trials))
        if ZERO in item.hidden:
            zeros = rng.standard_normal(len(zeros))
            zeros *= usual * rng.uniform(*ZEROS) / max(float(np.std(zeros)), 1e-9)
        if SCALE in item.hidden:
            scales = np.exp(rng.uniform(*np.log(SCALES), len(scales)))
        if not item.hidden and rng.random() < 0.5:
            zeros += usual * rng.uniform(-0.1, 0.1)  # of all trials: a cause of the library
        each = zip(made.trials, zeros, scales, strict=True)
        trials = tuple(t.with_columns(effort=np.round(s * t["effort"] + z, 6)) for t, z, s in each)
        common = ("effort_offset",) if not item.hidden and zeros.any() else ()
        true = {f"{ZERO} {t.name}": float(z) for t, z in zip(trials, zeros, strict=True) if ZERO in item.hidden}
        true |= {f"{SCALE} {t.name}": float(s) for t, s in zip(trials, scales, strict=True) if SCALE in item.hidden}
        return replace(made, trials=trials), Truth(true, common)


def free(causes: tuple[str, ...], rng: np.random.Generator, folder: Path) -> fp.Study:
    """Two to six trials of a hanging arm under sums of sines of other sizes, integrated by Runge and Kutta's method."""
    mass, about, damping = rng.uniform(0.5, 3.0), rng.uniform(0.01, 0.05), rng.uniform(0.05, 0.3)
    inertia, weight = about + mass * 0.04, 9.81 * mass * 0.2
    time = np.arange(round(rng.uniform(5.0, 9.0) / DT)) * DT
    least = SIZE * 0.5 * weight
    trials = []
    for k in range(int(rng.integers(2, 7))):
        sizes, waves = rng.uniform(0.2, 1.0, 3), rng.uniform(0.1, 1.5, 3)
        effort = sum(
            a * np.sin(2.0 * np.pi * f * time + rng.uniform(0, 6.28)) for a, f in zip(sizes, waves, strict=True)
        )
        effort = np.round(rng.uniform(0.3, 0.8) * weight * effort / float(np.abs(effort).max()), 4)

        def rates(t: float, x: np.ndarray, drive: float) -> list[float]:
            torque = drive - weight * np.sin(x[0]) - damping * x[1]
            if "coulomb_friction" in causes:
                torque -= least * np.tanh(x[1] / 0.05)
            if "quadratic_damping" in causes:
                torque -= 0.3 * least * x[1] * abs(x[1])
            if "parallel_stiffness" in causes:
                torque -= least * np.sinh(x[0] - 0.2)
            if "passive_relaxation" in causes:
                torque -= 2.0 * least * (x[0] - x[2])
            return [x[1], torque / inertia, (x[0] - x[2]) / 0.4]

        state, path = np.array([0.0, 0.0, 0.0]), np.empty(len(time))
        for i, drive in enumerate(effort):
            path[i] = state[0]
            state = solve_ivp(rates, (0.0, DT), state, "DOP853", args=(drive,), rtol=1e-8, atol=1e-10).y[:, -1]
        read = path + 5e-4 * rng.standard_normal(len(time))
        trials.append(Trial(f"{k:02d}", "motion", {"effort": effort, "position": read}, time))
    folder.mkdir(parents=True)
    lever = 0.2
    text = draw.URDF.format(name="arm", lever=f"0 0 {-lever}", mass=mass, about=about, kind="revolute", axis="0 1 0")
    (folder / "rig.urdf").write_text(text)
    start = {"inertia_scale": float(rng.uniform(0.8, 1.2)), "damping": float(damping * rng.uniform(0.5, 1.5))}
    return fp.Study("arm", "joint", {}, start, tuple(trials), folder, {"urdf": folder / "rig.urdf"})
