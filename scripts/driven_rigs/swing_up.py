"""Pendulums that are swung up and held on top: what they do there an encoder tells in counts, or not at all.

A pendulum is pumped until its energy is that of standing, with less torque than its weight, caught near the top and
held there; it begins anywhere near hanging. Encoders have 4096 to 131 072 counts a turn. Midpoint steps, as the
laboratory's.

Source: Astrom and Furuta, Swinging up a pendulum by energy control, Automatica 36 (2000).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from driven_rigs.draw import Base, Drawn, written
from driven_rigs.laboratory import FARTHEST, NEXT, Bench, hidden_numbers

CAUSES = ("coulomb_friction", "effort_offset", "quadratic_damping", "cogging", "parallel_stiffness")
PAIRS = (("coulomb_friction", "effort_offset"), ("coulomb_friction", "parallel_stiffness"))
INERTIAS = (0.004, 0.02, 0.06)
LENGTHS_M = (0.15, 0.35)
"""Of the mathematical pendulum that swings as fast, at least and at most."""
COUNTS = (4096, 16384, 131072)
"""Of an encoder, a turn."""
STEPS = (1e-3, 2e-3, 4e-3)
CAUGHT, LOST = 0.45, 0.9
"""Distance from the top at which it begins to be held, and at which that has failed, rad."""
START_S = 0.3
"""Of the first push, from hanging."""


@dataclass
class SwingUp(Bench):
    """A bench whose controller pumps, catches and holds; `wanted` says where the trials begin."""

    pumping: float = 1.0
    held: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    pushed_for: int = 0

    def command(
        self,
        error: np.ndarray,
        rate: np.ndarray,
        read: np.ndarray,
        wanted: np.ndarray,
        wanted_rate: np.ndarray,
        wanted_bend: np.ndarray,
    ) -> np.ndarray:
        b, most = self.base, self.hidden["most"]
        top = np.mod(read, 2.0 * np.pi) - np.pi
        self.held = np.abs(top) < np.where(self.held if len(self.held) else False, LOST, CAUGHT)
        holding = -(b.inertia * b.bandwidth**2 + b.weight) * top - 1.6 * b.inertia * b.bandwidth * rate
        energy = 0.5 * b.inertia * rate**2 - b.weight * np.cos(read)
        pumping = self.pumping * most * np.tanh(4.0 * (1.0 - energy / b.weight)) * np.where(rate >= 0.0, 1.0, -1.0)
        self.pushed_for += 1
        return np.where(self.held, holding, most if self.pushed_for * self.dt < START_S else pumping)


def draw_swing_up(causes: tuple[str, ...], seed: int, folder: Path) -> Drawn:
    """Draw a pendulum, hide causes in it, swing it up and hold it, and write the study."""
    rng = np.random.default_rng([seed, 78])
    inertia, dt, trials = float(rng.choice(INERTIAS)), float(rng.choice(STEPS)), int(rng.choice([2, 4]))
    weight = inertia * 9.81 / float(rng.uniform(*LENGTHS_M))
    damping = 0.01 * np.sqrt(inertia * weight) * float(rng.uniform(0.5, 3.0))
    base = Base("pendulum", inertia, damping, weight, np.pi, float(rng.uniform(8.0, 14.0)))
    time = np.arange(round(float(rng.uniform(6.0, 10.0)) / dt)) * dt
    begins = np.tile(rng.uniform(-0.3, 0.3, trials), (len(time), 1))
    most, pumping = weight * float(rng.uniform(0.25, 0.6)), float(rng.uniform(0.8, 1.6))

    def swung(hidden: dict[str, float], **read: float) -> tuple[np.ndarray, np.ndarray]:
        bench = SwingUp(base, dt, "swing up", begins, 0.0, {**hidden, "most": most}, pumping=pumping, **read)  # type: ignore[arg-type]
        with np.errstate(all="ignore"):
            return bench.run(np.random.default_rng([seed, 5]))

    usual = float(np.sqrt(np.mean(swung({})[0] ** 2)))
    plain = swung({})[1]
    hidden = hidden_numbers(causes, float(rng.uniform(0.05, 0.15)) * usual, plain, dt, 3.0, rng)
    read = {"count": 2.0 * np.pi / float(rng.choice(COUNTS)), "noise": float(rng.choice([1e-5, 1e-4]))}
    random = {"torque": usual * float(rng.uniform(0.002, 0.01)), "torque_s": float(rng.choice([0.02, 0.2]))}
    effort, position = swung(hidden, **read, **random)
    if not np.abs(position).max() < FARTHEST * base.reach:
        return draw_swing_up(causes, seed + NEXT, folder)
    effort = effort + usual * float(rng.choice([0.0, 0.002, 0.01])) * rng.standard_normal(effort.shape)
    believed = (float(rng.uniform(0.4, 1.5)), damping * float(rng.uniform(0.3, 2.0)))
    truth = {"inertia_scale": 1.0, "damping": damping, **hidden}
    return Drawn(written(base, effort, position, dt, believed, folder), base.name, causes, truth)
