"""Driven rigs that hide what has no form in the library: mechanisms near one of its causes, and faults near none.

The benches are those of the laboratory, the equations of motion and their integrator are not: rates of position,
velocity and one memory, by Ralston's third-order steps.

Sources: Canudas de Wit, Olsson, Astrom and Lischinsky, A new model for control of systems with friction, IEEE
Transactions on Automatic Control 40 (1995); Wen, Method for random vibration of hysteretic systems, J. Eng. Mech. Div.
ASCE 102 (1976); Ralston, Runge-Kutta methods with minimum error bounds, Mathematics of Computation 16 (1962).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from driven_rigs.draw import Drawn
from driven_rigs.laboratory import FINE_S, Bench, draw_laboratory

NEAREST: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "bristles": (("coulomb_friction",), ("passive_relaxation",)),
    "friction_by_angle": (("coulomb_friction",), ("cogging",)),
    "friction_by_direction": (("coulomb_friction", "effort_offset"), ()),
    "ripple": (("cogging",), ()),
    "hysteretic_spring": (("parallel_stiffness", "passive_relaxation", "coulomb_friction"), ()),
    "warming": (("coulomb_friction",), ()),
    "lost_packets": ((), ("sensor_lag",)),
    "bursts": ((), ()),
    "wander": ((), ("effort_offset", "zero_by_trial", "periodic_torque", "base_tilt")),
    "quantised_current": ((), ()),
}
"""Of what is hidden: the nearest causes, and others that describe a part of it, so that they are no wrong names.

Bristles are springs that slip, as a relaxing one; friction that rises along the way resists as teeth do where the joint
moves one way; a command that is lost acts late; a torque that wanders has a mean, of all trials or of each, and a
slowest wave, and a base that tilts has a mean too.
"""
CAUSES = tuple(NEAREST)
PAIRS = ((),)
"""One study more that hides nothing."""


@dataclass
class NoForm(Bench):
    """A bench whose `hidden` numbers are those of `NEAREST`; its memory is that of bristles or of a spring."""

    now: float = 0.0
    acted: np.ndarray = field(default_factory=lambda: np.zeros(0))
    wandered: np.ndarray = field(default_factory=lambda: np.zeros(0))
    noisy: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def numbers(
        self, causes: tuple[str, ...], torque: float, position: np.ndarray, rng: np.random.Generator
    ) -> dict[str, float]:
        (kind,) = causes or ("",)
        reach, speed = self.base.reach, float(np.sqrt(np.mean(np.gradient(position, self.dt, axis=0) ** 2)))
        size = {kind: torque, "creep": speed * rng.uniform(0.01, 0.05)}
        own: dict[str, dict[str, float]] = {
            "bristles": {
                "way": reach * np.exp(rng.uniform(*np.log([1e-3, 2e-2]))),
                "stiction": rng.uniform(0.0, 0.8),
                "falls": speed * rng.uniform(0.05, 0.3),
            },
            "friction_by_angle": {"uneven": rng.uniform(0.3, 0.8), "bends": rng.uniform(0.5, 3.0) / reach},
            "friction_by_direction": {"uneven": rng.uniform(0.2, 0.6) * rng.choice([-1.0, 1.0])},
            "ripple": {"waves": np.pi / reach * rng.uniform(4.0, 9.0), "by_current": rng.uniform(0.05, 0.2)},
            "hysteretic_spring": {
                "yields": reach * rng.uniform(0.1, 0.5),
                "elastic": rng.uniform(0.2, 0.6),
                "rest": reach * rng.uniform(-0.3, 0.3),
            },
            "warming": {
                "falls": rng.uniform(0.3, 0.7),
                "warms_s": len(position) * self.dt * rng.uniform(0.3, 1.5),
            },
            "lost_packets": {"lost": rng.uniform(0.01, 0.06)},
            "bursts": {"louder": rng.uniform(10.0, 40.0), "often_s": rng.uniform(1.0, 4.0)},
            "quantised_current": {"step": torque * rng.uniform(0.3, 1.0)},
        }
        return {**size, **own.get(kind, {})} if kind else {}

    def reads(self, k: int, q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        if not (often := self.hidden.get("often_s")):
            return super().reads(k, q, rng)
        self.noisy = np.zeros(len(q)) if k == 0 else self.noisy - self.dt
        starts = rng.random(len(q)) < self.dt / often
        self.noisy = np.where(starts, rng.uniform(0.03, 0.3, len(q)), self.noisy)
        louder = np.where(self.noisy > 0.0, self.hidden["louder"] * self.noise, 0.0)
        return super().reads(k, q + louder * rng.standard_normal(len(q)), rng)

    def acts(self, k: int, effort: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        x, self.now = self.hidden, k * self.dt
        if "lost" in x:
            lost = rng.random(len(effort)) < x["lost"]
            self.acted = np.where(lost, self.acted, effort) if k else effort
            return self.acted
        if "wander" in x:
            shock = x["wander"] * np.sqrt(1.0 / len(self.wanted)) * rng.standard_normal(len(effort))
            self.wandered = np.zeros(len(effort)) if k == 0 else self.wandered + shock
            return effort + self.wandered
        return np.round(effort / x["step"]) * x["step"] if "step" in x else effort

    def _step(
        self, drive: np.ndarray, q: np.ndarray, v: np.ndarray, bristles: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        h, x = self.dt / max(1, round(self.dt / FINE_S)), np.array([q, v, bristles])
        first = self._rates(drive, x)
        second = self._rates(drive, x + 0.5 * h * first)
        third = self._rates(drive, x + 0.75 * h * second)
        q, v, bristles = x + h / 9.0 * (2.0 * first + 3.0 * second + 4.0 * third)
        return q, v, bristles

    def _rates(self, drive: np.ndarray, state: np.ndarray) -> np.ndarray:
        """Rates of position, velocity and memory, shape (3, trials)."""
        q, v, z = state
        torque, bends = self._hides(drive, q, v, z)
        torque = torque + drive - self.base.damping * v - self.base.weight * np.sin(q)
        return np.array([v, torque / self.base.inertia, bends])

    def _hides(self, drive: np.ndarray, q: np.ndarray, v: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Torque of what is hidden, and the rate of its memory."""
        x, still = self.hidden, np.zeros_like(q)
        if size := x.get("bristles"):
            most = 1.0 + x["stiction"] * np.exp(-((v / x["falls"]) ** 2))
            bends, stiffness = v - np.abs(v) * z / (most * x["way"]), size / x["way"]
            return -stiffness * z - 0.5 * np.sqrt(stiffness * self.base.inertia) * bends, bends
        if size := x.get("hysteretic_spring"):
            stiffness, slips = 2.0 * size / self.base.reach, np.abs(z) * 0.5 * (1.0 + np.sign(v * z))
            springs = x["elastic"] * (q - x["rest"]) + (1.0 - x["elastic"]) * x["yields"] * z
            return -stiffness * springs, v / x["yields"] * (1.0 - slips)
        if size := x.get("ripple"):
            wave = x["waves"] * q
            teeth = size * (np.sin(wave) + 0.4 * np.sin(2.0 * wave + 1.0))
            return teeth + x["by_current"] * drive * np.cos(wave), still
        return -self._friction(q, v), still

    def _friction(self, q: np.ndarray, v: np.ndarray) -> np.ndarray | float:
        x = self.hidden
        if size := x.get("friction_by_angle"):
            size = size * (1.0 + x["uneven"] * np.sin(x["bends"] * q + 0.5))
        elif size := x.get("friction_by_direction"):
            size = size * (1.0 + x["uneven"] * np.sign(v))
        elif size := x.get("warming"):
            before = np.arange(len(q)) * len(self.wanted) * self.dt
            size = size * (1.0 - x["falls"] * (1.0 - np.exp(-(before + self.now) / x["warms_s"])))
        return size * np.tanh(v / x["creep"]) if size is not None else 0.0


def draw_no_form(causes: tuple[str, ...], seed: int, folder: Path) -> Drawn:
    """Draw a rig of the laboratory, hide one of `CAUSES` in it or nothing, run it, and write the study."""
    drawn = draw_laboratory(causes, seed, folder, NoForm)
    nearest, beside = NEAREST[causes[0]] if causes else ((), ())
    known = {n: drawn.truth[n] for n in ("inertia_scale", "damping")} if not causes else {}
    return replace(drawn, truth=known, beside=beside, nearest=nearest)
