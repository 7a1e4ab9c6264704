"""One joint of an industrial arm: a motor that a cascade controls, a link behind an elastic drive, a long record.

The encoder is the motor's, and fine. Its inertia counts as the link's does, times the square of the gear's ratio, and
whoever has the arm's drawings leaves it out: half or more of what moves is not believed. Bristles rub at the motor. The
drive bends: what is rigid to the library rings at 15 to 90 Hz. Other joints push at slow frequencies of their own, and
the gear pulls with its teeth; both are little, and may be named. Half implicit steps of an eighth of a millisecond.

Sources: bristles as in `laboratory`; drives: Spong, Modeling and control of elastic joint robots, ASME Journal of
Dynamic Systems, Measurement and Control 109 (1987); teeth: Tuttle and Seering, A nonlinear model of a harmonic drive
gear transmission, IEEE Transactions on Robotics and Automation 12 (1996).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from driven_rigs.draw import Base, Drawn, written

CAUSES = ("coulomb_friction",)
PAIRS = (("coulomb_friction", "cogging"),)
BESIDE = ("frame_vibration", "periodic_torque", "cogging")
"""What acts a little on every arm, and may be named: an elastic drive is the mode of another mass."""
FINE_S = 1.25e-4
CONTROLLED = 8
"""Fine steps from one to the next of the controller's."""
CURRENT_S = 8e-4
"""Of the loop that holds the current."""
RINGING = 0.3
"""Damping of bristles, as a share of what is critical."""
LOST = 0.02
"""The same of the drive."""


@dataclass(frozen=True)
class Arm:
    """A joint, in its own units: kg m^2 or kg, N m or N, rad or m."""

    motor: float
    link: float
    weight: float
    damping: float
    rings_hz: float
    rubs: float
    sticks: float
    way: float
    teeth: float
    waves: float
    others: float
    bandwidth: float
    count: float

    def run(self, wanted: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Currents as efforts, and readings of the motor, at the controller's steps; `wanted` at fine ones."""
        h, steps = FINE_S, len(wanted) // CONTROLLED
        reduced = self.motor * self.link / (self.motor + self.link)
        stiff = (2.0 * math.pi * self.rings_hz) ** 2 * reduced
        loss = 2.0 * LOST * math.sqrt(stiff * reduced)
        gain = 2.0 * (self.motor + self.link) * self.bandwidth
        frequencies, phases = rng.uniform(0.1, 1.0, 4), rng.uniform(0.0, 2.0 * math.pi, 4)
        pushed = sum(
            np.sin(2.0 * math.pi * f * h * np.arange(len(wanted)) + p) for f, p in zip(frequencies, phases, strict=True)
        )
        pushes = (self.others * pushed).tolist()
        slope = np.gradient(wanted[::CONTROLLED], CONTROLLED * h)
        effort, position = np.empty(steps), np.empty(steps)
        q, v, link_q, link_v, bent, current = float(wanted[0]), 0.0, float(wanted[0]), 0.0, 0.0, 0.0
        rate, gathered, last = 0.0, 0.0, q
        for k in range(steps):
            read = round(q / self.count) * self.count
            rate += 0.2 * ((read - last) / (CONTROLLED * h) - rate)
            last = read
            missed = self.bandwidth * (float(wanted[k * CONTROLLED]) - read) + float(slope[k]) - rate
            gathered += 0.5 * gain * self.bandwidth * missed * CONTROLLED * h
            command = gain * missed + gathered
            effort[k], position[k] = current, read
            for push in pushes[k * CONTROLLED : (k + 1) * CONTROLLED]:
                current += (command - current) * h / CURRENT_S
                rubbed, bent = self._rubs(v, bent, h)
                spring = stiff * (q - link_q) + loss * (v - link_v)
                tooth = self.teeth * math.sin(self.waves * q)
                v += h * (current + tooth + push - rubbed - self.damping * v - spring) / self.motor
                link_v += h * (spring - self.weight * math.sin(link_q)) / self.link
                q, link_q = q + h * v, link_q + h * link_v
        return effort, position

    def _rubs(self, v: float, bent: float, h: float) -> tuple[float, float]:
        """What bristles hold with, and how far they are bent then."""
        if not self.rubs:
            return 0.0, 0.0
        stiffness = self.rubs / self.way
        most = self.rubs * (1.0 + self.sticks * math.exp(-((v / 0.05) ** 2)))
        new = (bent + h * v) / (1.0 + h * abs(v) * stiffness / most)
        return stiffness * new + 2.0 * RINGING * math.sqrt(stiffness * self.motor) * (new - bent) / h, new


def draw_arm(causes: tuple[str, ...], seed: int, folder: Path) -> Drawn:
    """Draw an arm, hide causes in it, move it under its controller, and write the study: one trial of 20 to 65 s."""
    rng = np.random.default_rng([seed, 79])
    motor = float(rng.uniform(0.3, 1.5))
    link, weight = motor * float(rng.uniform(0.3, 1.0)), float(rng.choice([0.0, rng.uniform(5.0, 20.0)]))
    reach, usual = float(rng.uniform(0.5, 1.0)), float(rng.uniform(5.0, 9.0))
    wanted = reach * _wanted(float(rng.uniform(20.0, 65.0)), rng)
    arm = Arm(
        motor=motor,
        link=link,
        weight=weight,
        damping=float(rng.uniform(1.0, 5.0)),
        rings_hz=float(np.exp(rng.uniform(*np.log([15.0, 90.0])))),
        rubs=float(rng.uniform(3.0, 8.0)) if "coulomb_friction" in causes else 0.0,
        sticks=float(rng.uniform(0.0, 0.4)),
        way=float(np.exp(rng.uniform(*np.log([5e-5, 1e-3])))),
        teeth=usual * (0.06 if "cogging" in causes else float(rng.choice([0.0, 0.01]))),
        waves=float(rng.choice([40.0, 100.0, 200.0])),
        others=usual * float(rng.choice([0.0, 0.01])),
        bandwidth=float(rng.uniform(13.0, 22.0)),
        count=reach * float(np.exp(rng.uniform(*np.log([2e-6, 1e-4])))),
    )
    effort, position = arm.run(wanted, rng)
    every = int(rng.choice([1, 2, 4, 10]))
    effort, position = effort[::every], position[::every]
    size = float(np.sqrt(np.mean(effort**2)))
    effort = effort + size * float(rng.choice([0.002, 0.01])) * rng.standard_normal(len(effort))
    effort = np.round(effort / (0.002 * size)) * 0.002 * size
    base = Base("arm", motor + link, arm.damping, weight, reach, arm.bandwidth)
    believed = (link / (motor + link), 1.0)
    truth = {"inertia_scale": 1.0, "damping": arm.damping, "coulomb_friction.torque_nm": arm.rubs}
    study = written(base, effort[:, None], position[:, None], every * CONTROLLED * FINE_S, believed, folder)
    return Drawn(study, base.name, causes, truth, BESIDE)


def _wanted(seconds: float, rng: np.random.Generator) -> np.ndarray:
    """Five harmonics of a tenth of a hertz, or moves of least jerk from place to place with rests, within 1."""
    time = np.arange(round(seconds / FINE_S)) * FINE_S
    if rng.random() < 0.6:
        parts = zip(range(1, 6), rng.uniform(0.1, 1.0, 5), rng.uniform(0.0, 2.0 * math.pi, 5), strict=True)
        waves = sum(a / j * np.sin(0.2 * math.pi * j * time + p) for j, a, p in parts)
        waves = waves - waves[0]
        return np.asarray(waves / np.abs(waves).max() * np.minimum(1.0, time))
    out, place, k = np.zeros(len(time)), 0.0, round(0.3 / FINE_S)
    while k < len(out):
        target = float(rng.uniform(-1.0, 1.0))
        s = np.linspace(0.0, 1.0, round(max(abs(target - place) * float(rng.uniform(0.8, 1.6)), 0.3) / FINE_S))
        rests = np.full(round(float(rng.uniform(0.1, 0.6)) / FINE_S), target)
        piece = np.concatenate([place + (target - place) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2), rests])[
            : len(out) - k
        ]
        out[k : k + len(piece)] = piece
        k, place = k + len(piece), target
    return out
