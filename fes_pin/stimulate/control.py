"""Position control of the ankle by pulse width, 45 times a second.

    reference -> feedforward: eq. (1) turned round, the activation's lag turned round
              -> + feedback on the estimated state
              -> inverse recruitment -> pulse width

The feedback's gains are those of a linear quadratic regulator at each angle. Its one weight follows a rule: one degree
of error is worth `boldness` of the muscle (Bryson's rule), and `boldness` is that of a ladder with which the linear
loop, its observer included, decays fastest at the worst corner of +-30 % in gain, time constant and stiffness over the
whole range of angles; of several that are as good, the boldest.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from fes_pin.models.effects import RecruitmentHysteresis
from fes_pin.models.model import Model
from fes_pin.stimulate.endurance import EnduranceWatch, fatigue_of
from fes_pin.stimulate.observer import PULSE_S, AnkleDynamics, JointObserver, transition
from fes_pin.stimulate.pulse import PulseWidth
from fes_pin.stimulate.recruitment import LinearRecruitment
from fes_pin.stimulate.reference import LOOKAHEAD, ReferenceWindow

DEGREE = math.pi / 180.0
LADDER = (0.5, 0.35, 0.25, 0.18, 0.12, 0.08, 0.05, 0.03)
"""Shares of the muscle that one degree of error may be worth, boldest first."""
AS_GOOD = 0.002
"""Difference of two moduli, per pulse, that does not count."""
UNCERTAINTY = 0.3
"""Of gain, time constant and stiffness."""
ANGLES = 9
"""Angles that gains are computed for."""
BLIND_S = 1.0
"""A joint that has not been seen for this long is no longer stimulated."""
MARGIN_RAD = 2.0 * DEGREE
"""A reference is held this far inside of what the muscle can reach, as a share is kept for the feedback."""


@dataclass(frozen=True)
class Gains:
    """Feedback of (share times activation, angle, rate) to recruitment, by angle.

    Attributes
    ----------
    angles
        Shape (n,), rad.
    table
        Shape (n, 3).
    boldness
        As the rule chose it.
    radius
        Largest modulus of the loop's eigenvalues over corners and angles.
    """

    angles: np.ndarray
    table: np.ndarray
    boldness: float
    radius: float

    def at(self, angle: float) -> list[float]:
        """The three gains at an angle, between the table's by straight lines."""
        first, last = float(self.angles[0]), float(self.angles[-1])
        place = min(max((angle - first) / (last - first), 0.0), 1.0) * (len(self.angles) - 1)
        k = min(int(place), len(self.angles) - 2)
        low, high, part = self.table[k].tolist(), self.table[k + 1].tolist(), place - k
        return [a + part * (b - a) for a, b in zip(low, high, strict=True)]


def plant(dynamics: AnkleDynamics, q: float) -> tuple[np.ndarray, np.ndarray, float]:
    """The joint held at an angle, from pulse to pulse: transition (4, 4) of (activation, angle, rate, torque), input
    (4,), and torque that full activation makes.
    """
    f = np.zeros((5, 5))
    f[:4, :4] = dynamics.linear(q, dynamics.activation_for(q), 1.0)[:4, :4]
    f[0, 4] = 1.0 / dynamics.time_constant
    a = transition(f, PULSE_S)
    return a[:4, :4], a[:4, 4], dynamics.pull_nm * math.sin(q)


def regulator(dynamics: AnkleDynamics, q: float, boldness: float) -> np.ndarray:
    """Linear quadratic gains at an angle, shape (3,)."""
    a, b, _ = plant(dynamics, q)
    a, b = a[:3, :3], b[:3, None]
    cost = np.diag([1e-6, (boldness / DEGREE) ** 2, 1e-6])
    p = scipy.linalg.solve_discrete_are(a, b, cost, np.eye(1))
    return np.linalg.solve(np.eye(1) + b.T @ p @ b, b.T @ p @ a)[0]


def corners(dynamics: AnkleDynamics) -> list[AnkleDynamics]:
    """Ankles that differ by +-30 % in gain, time constant and stiffness."""
    low, high = 1.0 - UNCERTAINTY, 1.0 + UNCERTAINTY
    found = []
    for gain, tau, stiff in itertools.product((low, high), repeat=3):
        other = replace(dynamics, pull_nm=dynamics.pull_nm * gain, time_constant=dynamics.time_constant * tau)
        found.append(replace(other, f1=dynamics.f1 * stiff))
    return found


def loop_radius(truth: AnkleDynamics, believed: AnkleDynamics, q: float, k: np.ndarray, observer: np.ndarray) -> float:
    """Largest eigenvalue modulus of plant, observer and feedback together, at one angle.

    Parameters
    ----------
    k
        Feedback, shape (3,).
    observer
        Steady Kalman gain of (activation, angle, rate, torque), shape (4,).
    """
    a, b, _ = plant(truth, q)
    model_a, model_b, pull = plant(believed, q)
    # r = -k (x - x*) + x*_act, with x*_act = -torque / pull
    law = np.r_[-k, -(1.0 + k[0]) / pull]
    see = np.array([0.0, 1.0, 0.0, 0.0])
    keep = np.eye(4) - np.outer(observer, see)
    correct = np.outer(observer, see[:3])
    ours = model_a @ keep + np.outer(model_b, law @ keep)
    top = np.hstack([a[:3, :3] + np.outer(b[:3], law @ correct), np.outer(b[:3], law @ keep)])
    bottom = np.hstack([model_a @ correct + np.outer(model_b, law @ correct), ours])
    return float(np.abs(np.linalg.eigvals(np.vstack([top, bottom]))).max())


def tune(dynamics: AnkleDynamics, observer: JointObserver) -> Gains:
    """The gains of the rule; see the module."""
    angles = np.linspace(dynamics.rest_angle(), dynamics.rest_angle(1.0), ANGLES)
    steady = []
    for q in angles:
        a, _, _ = plant(dynamics, q)
        p = scipy.linalg.solve_discrete_are(
            a.T, np.eye(4)[:, [1]], observer.noise[:4, :4] + 1e-12 * np.eye(4), np.array([[observer.variance]])
        )
        steady.append(p[:, 1] / (p[1, 1] + observer.variance))
    tried = []
    for boldness in LADDER:
        table = np.array([regulator(dynamics, q, boldness) for q in angles])
        radius = max(
            loop_radius(other, dynamics, q, k, see)
            for q, k, see in zip(angles[::2], table[::2], steady[::2], strict=True)
            for other in (dynamics, *corners(dynamics))
        )
        tried.append(Gains(angles, table, boldness, radius))
    least = min(g.radius for g in tried)
    return next(g for g in tried if g.radius <= least + AS_GOOD)


class PositionController:
    """Holds an ankle to a reference by pulse width; call `step` once per pulse.

    Parameters
    ----------
    model
        The ankle as identified; of its effects, `recruitment_hysteresis` is compensated, and `fatigue` tells how long
        the muscle will last.
    load_kg
        M.
    observer
        State estimate; by default one with the noise levels of `JointObserver`.

    Attributes
    ----------
    recruitment
        That the nerve got in the last pulse.
    wanted_rad
        The reference as the joint is to follow it now: smoothed and held within reach.
    short_of
        Recruitment that was wanted beyond what the muscle has, in the last pulse.
    """

    def __init__(self, model: Model, load_kg: float = 0.0, observer: JointObserver | None = None) -> None:
        dynamics = AnkleDynamics.of(model, load_kg)
        constants = model.rig.constants
        play = [e.half_width_us for e in model.effects if isinstance(e, RecruitmentHysteresis)]
        curve = LinearRecruitment(constants["threshold_us"], constants["saturation_us"])
        self.pulse = PulseWidth(curve, play[0] if play else 0.0)
        self.dynamics = dynamics
        self.observer = observer if observer is not None else JointObserver(dynamics)
        self.gains = tune(dynamics, self.observer)
        self.lowest, self.fade = dynamics.rest_angle(), math.exp(-PULSE_S / dynamics.time_constant)
        self.window = ReferenceWindow(self.lowest)
        self.recruitment = self.short_of = 0.0
        self.wanted_rad = self.lowest
        self.highest = dynamics.rest_angle(1.0)
        self.count = 0
        fatigue = fatigue_of(model)
        self.watch = EnduranceWatch(fatigue) if fatigue else None

    @property
    def share(self) -> float:
        """Share of the believed gain that the muscle has: below 1 it is tired."""
        return float(self.observer.x[4])

    def step(self, angle_rad: float, reference_rad: float | Sequence[float]) -> float:
        """One pulse: the pulse width in us from a reading and the reference.

        Parameters
        ----------
        angle_rad
            As measured now; NaN or None if there is none.
        reference_rad
            The angle wanted now and at the next `LOOKAHEAD` pulses; a single number is taken for the last of these, so
            the joint follows it `LOOKAHEAD` pulses late. What is not finite is replaced by the value before it.

        Returns
        -------
        float
            0, or threshold to saturation, whatever comes in.
        """
        if self.count % 15 == 0:
            self._reach()
        self.count += 1
        self.window.take(reference_rad, self.lowest, self.highest)
        self.observer.correct(angle_rad)
        if self.observer.blind * PULSE_S > BLIND_S:
            width, self.recruitment = self.pulse(0.0)
        else:
            wanted = self._law()
            width, self.recruitment = self.pulse(wanted)
            self.short_of = max(wanted - 1.0, 0.0)
        if self.watch is not None:
            self.watch.take(float(self.observer.x[0]) * self.share, self.share)
        self.observer.predict(self.recruitment)
        return width

    @property
    def warning(self) -> str:
        """One line, some time before the muscle can no longer do what it has been doing; else empty."""
        return self.watch.warning if self.watch is not None else ""

    def _reach(self) -> None:
        """How far the muscle can move the joint now."""
        full = self.dynamics.rest_angle(self.share + self.observer.x[3] / self.dynamics.pull_nm)
        self.highest = max(full - MARGIN_RAD, self.lowest)

    def _law(self) -> float:
        q, v, acceleration, next_q, next_v, next_acceleration = self.window.now()
        self.wanted_rad = q
        act, angle, rate, torque, share = self.observer.x.tolist()
        now = self.dynamics.activation_for(q, v, acceleration, torque)
        then = self.dynamics.activation_for(next_q, next_v, next_acceleration, torque)
        # the lag turned round: what recruitment takes the activation from now to then in one pulse
        feedforward = (then - self.fade * now) / (1.0 - self.fade)
        k = self.gains.at(angle)
        feedback = k[0] * (now - share * act) + k[1] * (q - angle) + k[2] * (v - rate)
        return (feedforward + feedback) / share


__all__ = ["LOOKAHEAD", "Gains", "PositionController", "tune"]
