"""Driven rigs as other laboratories have them: a second generator, which shares no dynamics with the first.

Controllers with an integral, with what is wanted fed forward, or as a cascade; moves from point to point at limited
speed, chirps, reaches of minimum jerk, sines; one to six trials of four seconds to a minute in all, at 100 Hz to 1 kHz;
encoders of 10 to 15 bits over the way; a current that is limited, counted, and read with noise. Dry friction is that
of bristles that ring (LuGre); midpoint steps of a quarter of a millisecond.

Source of bristles: Canudas de Wit, Olsson, Astrom and Lischinsky, A new model for control of systems with friction,
IEEE Transactions on Automatic Control 40 (1995).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from driven_rigs.draw import Base, Drawn, sizes, written

CAUSES = ("coulomb_friction", "effort_offset", "parallel_stiffness", "quadratic_damping", "joint_stop", "cogging")
PAIRS = (("coulomb_friction", "effort_offset"), ("coulomb_friction", "parallel_stiffness"))
BASES = (
    Base("slide", 80.0, 150.0, 0.0, 0.3, 12.0),
    Base("small slide", 1.2, 2.0, 0.0, 0.15, 18.0),
    Base("arm", 0.35, 0.6, 6.0, 0.8, 9.0),
    Base("knee", 0.25, 0.3, 9.0, 0.7, 9.0),
    Base("upright", 0.08, 0.05, -2.5, 0.4, 12.0),
    Base("servo", 0.02, 0.03, 0.8, 1.0, 14.0),
)
STEPS = (1e-3, 2e-3, 5e-3, 1e-2)
LONGEST_S = 60.0
"""Of all trials together."""
FINE_S = 2.5e-4
RINGING = 0.15
"""Damping of bristles, as a share of what is critical."""
FARTHEST, NEXT = 5.0, 10_000_000
"""Beyond so many reaches a controller has lost its rig: another is drawn, from a seed so much larger."""
FILTER_S = 0.008
"""Over which a controller averages the differences of its reading."""


@dataclass
class Bench:
    """One rig on its bench, all trials side by side: arrays of shape (trials,)."""

    base: Base
    dt: float
    control: str
    wanted: np.ndarray
    integral: float
    hidden: dict[str, float] = field(default_factory=dict)
    noise: float = 0.0
    count: float = 0.0
    torque: float = 0.0
    torque_s: float = 0.2

    def run(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Efforts that were commanded and positions that were read, shape (n, trials)."""
        n, trials = self.wanted.shape
        effort, position = np.empty((n, trials)), np.empty((n, trials))
        q, v, bristles, pushed = self.wanted[0].copy(), np.zeros(trials), np.zeros(trials), np.zeros(trials)
        rate, gathered, last = np.zeros(trials), np.zeros(trials), self.wanted[0].copy()
        lasts = np.exp(-self.dt / self.torque_s)
        wanted_rate = np.gradient(self.wanted, self.dt, axis=0)
        wanted_bend = np.gradient(wanted_rate, self.dt, axis=0)
        for k in range(n):
            read = self.reads(k, q, rng)
            rate += min(1.0, self.dt / FILTER_S) * ((read - last) / self.dt - rate)
            last, error = read, self.wanted[k] - read
            gathered += self.integral * error * self.dt
            command = self.command(error, rate, read, self.wanted[k], wanted_rate[k], wanted_bend[k]) + gathered
            most = self.hidden.get("most", np.inf)
            effort[k], position[k] = np.clip(command, -most, most), read
            pushed = lasts * pushed + self.torque * np.sqrt(1.0 - lasts**2) * rng.standard_normal(trials)
            acting = self.acts(k, effort[k], rng)
            for _ in range(max(1, round(self.dt / FINE_S))):
                q, v, bristles = self._step(acting + pushed, q, v, bristles)
        return effort, position

    def reads(self, k: int, q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """What the encoder reads at a sample."""
        read = q + self.noise * rng.standard_normal(len(q))
        return np.round(read / self.count) * self.count if self.count else read

    def acts(self, k: int, effort: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """What of a commanded effort acts from a sample to the next."""
        return effort

    def numbers(
        self, causes: tuple[str, ...], torque: float, position: np.ndarray, rng: np.random.Generator
    ) -> dict[str, float]:
        """Numbers of what is hidden, so that each acts with about this torque."""
        return hidden_numbers(causes, torque, position, self.dt, self.base.reach, rng)

    def command(
        self,
        error: np.ndarray,
        rate: np.ndarray,
        read: np.ndarray,
        wanted: np.ndarray,
        wanted_rate: np.ndarray,
        wanted_bend: np.ndarray,
    ) -> np.ndarray:
        """The effort that the controller asks for."""
        b = self.base
        stiff, damped = b.inertia * b.bandwidth**2 + abs(b.weight), 1.4 * b.inertia * b.bandwidth
        if self.control == "cascade":
            return damped * (0.5 * b.bandwidth * error + wanted_rate - rate) + 0.7 * b.weight * np.sin(read)
        ahead = 0.8 * b.inertia * wanted_bend + damped * wanted_rate + 0.9 * b.weight * np.sin(wanted)
        return stiff * error - damped * rate + (ahead if self.control == "fed forward" else 0.0)

    def _step(
        self, drive: np.ndarray, q: np.ndarray, v: np.ndarray, bristles: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The midpoint rule; bristles bend by an implicit step: z' = v - |v| z / way."""
        h = self.dt / max(1, round(self.dt / FINE_S))
        force, bent = self._bristles(v, bristles, h)
        half_v = v + 0.5 * h * (self._accelerates(drive, q, v) - force / self.base.inertia)
        half_q = q + 0.5 * h * v
        force, bent = self._bristles(half_v, bristles, h)
        new_v = v + h * (self._accelerates(drive, half_q, half_v) - force / self.base.inertia)
        return q + h * half_v, new_v, bent

    def _bristles(self, v: np.ndarray, z: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
        if not (size := self.hidden.get("coulomb_friction", 0.0)):
            return np.zeros_like(v), z
        way = self.hidden["way"]
        bent = (z + h * v) / (1.0 + h * np.abs(v) / way)
        middle, stiffness = 0.5 * (z + bent), size / way
        ringing = 2.0 * RINGING * np.sqrt(stiffness * self.base.inertia)
        return stiffness * middle + ringing * (v - np.abs(v) * middle / way), bent

    def _accelerates(self, drive: np.ndarray, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        b, x = self.base, self.hidden
        torque = drive - b.damping * v - b.weight * np.sin(q) + x.get("effort_offset", 0.0)
        if size := x.get("parallel_stiffness"):
            torque -= size * (q - x["rest"])
        if size := x.get("quadratic_damping"):
            torque -= size * v * np.abs(v)
        if size := x.get("joint_stop"):
            torque -= size * np.maximum(q - x["at"], 0.0)
        if size := x.get("cogging"):
            torque -= size * np.sin(x["waves"] * q)
        return torque / b.inertia


def draw_laboratory(causes: tuple[str, ...], seed: int, folder: Path, kind: type[Bench] = Bench) -> Drawn:
    """Draw a rig, hide causes in it, run it under its controller on a bench of a kind, and write the study."""
    rng = np.random.default_rng([seed, 77])
    base, dt = BASES[int(rng.integers(len(BASES)))], float(rng.choice(STEPS))
    trials = int(rng.choice([1, 2, 3, 4, 6]))
    time = np.arange(round(min(float(rng.uniform(4.0, 25.0)), LONGEST_S / trials) / dt)) * dt
    motion = MOTIONS[int(rng.integers(len(MOTIONS)))]
    wanted = np.stack([base.reach * motion(time, rng) for _ in range(trials)], axis=1)
    control = str(rng.choice(["integral", "fed forward", "cascade"]))
    bandwidth = base.bandwidth * float(rng.uniform(0.7, 1.3)) * min(1.0, 5e-3 / dt)
    own = Base(base.name, base.inertia, base.damping, base.weight, base.reach, bandwidth)
    slow = 0.08 * base.inertia * bandwidth**3 * (control == "integral" or float(rng.random() < 0.3))
    bench = kind(own, dt, control, wanted, slow)
    effort, position = bench.run(np.random.default_rng([seed, 5]))
    usual = float(np.sqrt(np.mean(effort**2)))
    bench.hidden = bench.numbers(causes, float(rng.uniform(0.15, 0.4)) * usual, position, rng)
    bench.hidden["most"] = float(rng.choice([np.inf, np.inf, 1.1])) * max(float(np.abs(effort).max()), 2.0 * usual)
    bench.count = base.reach * float(np.exp(rng.uniform(*np.log([5e-5, 1.5e-3]))))
    bench.noise = base.reach * float(np.exp(rng.uniform(*np.log([2e-5, 6e-4]))))
    bench.torque, bench.torque_s = usual * float(rng.uniform(0.003, 0.02)), float(rng.choice([0.02, 0.2]))
    with np.errstate(all="ignore"):
        effort, position = bench.run(np.random.default_rng([seed, 5]))
    if not np.abs(position).max() < FARTHEST * base.reach:
        return draw_laboratory(causes, seed + NEXT, folder, kind)
    effort = effort + usual * float(rng.choice([0.0, 0.003, 0.01])) * rng.standard_normal(effort.shape)
    step = usual * float(rng.choice([0.0, 0.005]))
    effort = np.round(effort / step) * step if step else effort
    believed = (float(rng.uniform(0.6, 1.5)), base.damping * float(rng.uniform(0.3, 2.0)))
    truth = {"inertia_scale": 1.0, "damping": base.damping, **bench.hidden}
    return Drawn(written(base, effort, position, dt, believed, folder), base.name, causes, truth)


def hidden_numbers(
    causes: tuple[str, ...], torque: float, position: np.ndarray, dt: float, reach: float, rng: np.random.Generator
) -> dict[str, float]:
    """Numbers of what is hidden, so that each acts with about this torque."""
    speed = float(np.sqrt(np.mean(np.gradient(position, dt, axis=0) ** 2)))
    out: dict[str, float] = {}
    for cause in causes:
        if cause == "coulomb_friction":
            out |= {cause: torque, "way": reach * float(np.exp(rng.uniform(*np.log([3e-4, 4e-3]))))}
        else:
            out |= sizes((cause,), torque, position, speed, rng)
    return out


def _places(time: np.ndarray, rng: np.random.Generator, shape: str) -> np.ndarray:
    """Moves from place to place within 1, as `shape` has them, with rests between."""
    out, place, k, dt = np.zeros_like(time), 0.0, round(0.3 / (time[1] - time[0])), time[1] - time[0]
    while k < len(time):
        target = float(rng.uniform(-1.0, 1.0))
        lasts = max(abs(target - place) * float(rng.uniform(0.7, 1.5)), 0.25)
        s = np.minimum(np.arange(1, round(lasts / dt) + 1) * dt / lasts, 1.0)
        jerk = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        limited = np.where(s < 0.2, s**2 / 0.32, np.where(s < 0.8, (s - 0.1) / 0.8, 1.0 - (1.0 - s) ** 2 / 0.32))
        moved = place + (target - place) * (jerk if shape == "jerk" else limited)
        rests = np.full(round(float(rng.uniform(0.05, 0.6)) / dt), target)
        piece = np.concatenate([moved, rests])[: len(time) - k]
        out[k : k + len(piece)] = piece
        k, place = k + len(piece), target
    return out


def _chirp(time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    slow, fast = 0.05, float(rng.uniform(0.8, 2.0))
    turns = slow * time + (fast - slow) * time**2 / (2.0 * time[-1])
    return float(rng.uniform(0.4, 0.9)) * np.sin(2.0 * np.pi * turns)


def _sines(time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    parts = zip(rng.uniform(0.1, 1.2, 4), rng.uniform(0.2, 1.0, 4), rng.uniform(0.0, 6.28, 4), strict=True)
    waves = sum(a * np.sin(2.0 * np.pi * f * time + p) for f, a, p in parts)
    waves = waves - waves[0]
    return waves / np.abs(waves).max() * np.minimum(1.0, time / 0.5)


MOTIONS = (
    lambda time, rng: _places(time, rng, "limited"),
    lambda time, rng: _places(time, rng, "jerk"),
    _chirp,
    _sines,
)
