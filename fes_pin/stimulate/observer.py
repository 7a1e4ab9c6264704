"""State of a stimulated ankle from its angle, one sample to a pulse: an extended Kalman filter.

State: activation, angle, rate, a torque that the model does not know, and the share of the believed gain that the
muscle has. The torque wanders (it takes up what is wrong in passive curve, load and damping), the gain's share wanders
more slowly (it takes up fatigue). What is fed in is the recruitment that the nerve really got, after every limit: a
limit that holds the stimulus back leaves nothing to wind up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.models.model import Model
from fes_pin.models.rigs.ankle import Ankle
from fes_pin.models.rigs.base import GRAVITY
from fes_pin.models.rigs.rigid import gravity_coefficients, point_foot

PULSE_S = 1.0 / 45.0
"""Time between pulses, s; Dombre, Fournier and Coiffet, section II-3-1."""
STEPS = 5
"""Integration steps per pulse: 4.4 ms, 1/4 of the joint's fastest radian."""
GATE = 25.0
"""Squared innovation in units of its variance from which a reading counts as a spike: five standard deviations."""
PATIENCE = 6
"""Spikes in a row after which the sensor is right and the state is wrong."""
LEAST_SHARE, MOST_SHARE = 0.1, 2.0
"""Bounds of the gain's share."""


@dataclass(frozen=True)
class AnkleDynamics:
    """Eq. (1) as plain numbers: the ankle that a controller believes in, with one load.

    Attributes
    ----------
    pull_nm
        a K F_ref: torque of full activation at sin(theta) = 1, N m.
    """

    inertia: float
    damping: float
    time_constant: float
    pull_nm: float
    lever: float
    f0: float
    f1: float
    theta_r: float
    load_n: float
    gravity_cos: float
    gravity_sin: float

    @classmethod
    def of(cls, model: Model, load_kg: float) -> AnkleDynamics:
        """From an ankle's model; its effects are not used.

        Raises
        ------
        InputError
            For another rig, or a load that is none.
        """
        if not isinstance(model.rig, Ankle):
            raise InputError(f"position control needs the rig ankle, found {model.rig.name}")
        if not (math.isfinite(load_kg) and load_kg >= 0.0):
            raise InputError(f"expected a load of at least 0 kg, found {load_kg:g}")
        rig, c = model.rig, {n: float(v) for n, v in model.rig.constants.items()}
        a, b = gravity_coefficients(point_foot(c["foot_mass_kg"], c["com_distance_m"]))
        return cls(
            rig.inertia_kgm2,
            rig.damping_nms,
            rig.time_constant_s,
            c["moment_arm_m"] * rig.gain * c["force_scale_n"],
            c["com_distance_m"],
            c["f0_n"],
            c["f1_per_rad"],
            c["theta_r_rad"],
            load_kg * GRAVITY,
            a,
            b,
        )

    def passive(self, q: float) -> tuple[float, float]:
        """Torque of antagonist, load and weight at an angle, N m, and its slope, N m/rad."""
        grown = self.f0 * math.exp(self.f1 * min(max(q - self.theta_r, 0.0), 3.0))
        pull = grown - self.f0 - self.load_n if q > self.theta_r else -self.load_n
        slope = self.f1 * grown if q > self.theta_r else 0.0
        s, c = math.sin(q), math.cos(q)
        torque = -self.lever * pull * s - self.gravity_cos * c - self.gravity_sin * s
        return torque, -self.lever * (slope * s + pull * c) + self.gravity_cos * s - self.gravity_sin * c

    def moved(self, q: float, pull_nm: float) -> float:
        """Torque of a muscle that pulls so, with the passive torque, at an angle; N m."""
        grown = self.f0 * (math.exp(self.f1 * min(q - self.theta_r, 3.0)) - 1.0) if q > self.theta_r else 0.0
        held = pull_nm - self.lever * (grown - self.load_n) - self.gravity_sin
        return held * math.sin(q) - self.gravity_cos * math.cos(q)

    def rest_angle(self, activation: float = 0.0) -> float:
        """Angle in rad that a steady activation of the believed muscle holds; by bisection."""
        low, high = 0.3, 2.8
        for _ in range(50):
            middle = 0.5 * (low + high)
            rising = self.passive(middle)[0] + self.pull_nm * activation * math.sin(middle) > 0.0
            low, high = (middle, high) if rising else (low, middle)
        return 0.5 * (low + high)

    def activation_for(self, q: float, v: float = 0.0, acceleration: float = 0.0, torque: float = 0.0) -> float:
        """Activation (times gain share) that moves the joint so against an unknown `torque`; unbounded."""
        needed = self.inertia * acceleration + self.damping * v - self.passive(q)[0] - torque
        return needed / (self.pull_nm * max(math.sin(q), 0.05))

    def linear(self, q: float, activation: float, share: float) -> np.ndarray:
        """Derivative of the rates of (activation, angle, rate, torque, share), shape (5, 5)."""
        s, j = math.sin(q), self.inertia
        stiff = (self.pull_nm * share * activation * math.cos(q) + self.passive(q)[1]) / j
        pull = self.pull_nm * s / j
        f = np.zeros((5, 5))
        f[0, 0], f[1, 2] = -1.0 / self.time_constant, 1.0
        f[2] = pull * share, stiff, -self.damping / j, 1.0 / j, pull * activation
        return f


def transition(f: np.ndarray, time: float) -> np.ndarray:
    """exp(f time) by scaling and squaring; to 1e-6 for the ankle."""
    small = f * (time / 8.0)
    square = small @ small
    a = np.eye(len(f)) + small + square * 0.5 + square @ small * (1.0 / 6.0)
    a = a @ a
    a = a @ a
    return a @ a


class JointObserver:
    """See the module.

    Parameters
    ----------
    dynamics
        The ankle as believed.
    angle_std_rad
        Noise of the potentiometer.
    torque_wander
        Standard deviation of the unknown torque's change in a second, N m: quicker ones answer a
        swinging frame and feed it (0.05 does), slower ones leave play uncompensated (0.01 does).
    share_wander
        The same of the gain's share; 0.02 follows a muscle that loses 40 % in 30 s.
    share_std
        How wrong the gain may be at the start.

    Attributes
    ----------
    x, p
        Mean (5,) and covariance (5, 5).
    blind
        Pulses since the last reading that was believed.
    """

    def __init__(
        self,
        dynamics: AnkleDynamics,
        angle_std_rad: float = 2e-3,
        torque_wander: float = 0.03,
        share_wander: float = 0.02,
        share_std: float = 0.3,
    ) -> None:
        if not (angle_std_rad > 0.0 and torque_wander > 0.0 and share_wander >= 0.0 and share_std > 0.0):
            raise InputError("expected noise of the angle, and of torque and gain, above 0")
        self.dynamics, self.variance = dynamics, angle_std_rad**2
        wander = [0.01, 0.0, 0.5, torque_wander, share_wander]
        self.noise = np.diag(np.square(wander)) * PULSE_S
        self.start = np.array([0.0, dynamics.rest_angle(), 0.0, 0.0, 1.0])
        self.start_p = np.diag([0.01, 0.1, 0.1, 0.3, share_std]) ** 2
        self.reset()

    def reset(self) -> None:
        """Forget everything: at rest, fresh."""
        self.x, self.p = self.start.copy(), self.start_p.copy()
        self.blind = self.spikes = 0

    def correct(self, angle_rad: float) -> bool:
        """Take in a reading; False if it is none, no angle, or a spike."""
        believed = isinstance(angle_rad, (float, int)) and 0.0 < angle_rad < math.pi
        if believed:
            innovation = angle_rad - self.x[1]
            size = self.p[1, 1] + self.variance
            if innovation * innovation > GATE * size:
                self.spikes += 1
                believed = self.spikes > PATIENCE
                if believed:
                    self._restart_at(angle_rad)
                    return True
        if not believed:
            self.blind += 1
            return False
        self.spikes = self.blind = 0
        gain = self.p[:, 1] / size
        self.x += gain * innovation
        self.p -= np.outer(gain, self.p[1])
        self._bound()
        return True

    def _restart_at(self, angle_rad: float) -> None:
        share = self.x[4]
        self.reset()
        self.x[1], self.x[4] = angle_rad, share

    def predict(self, recruitment: float) -> None:
        """Go on by one pulse with this recruitment in the nerve."""
        act, q, v, torque, share = self.x.tolist()
        change = transition(self.dynamics.linear(q, act, share), PULSE_S)
        self.x[:3] = self._moved(act, q, v, torque, share, recruitment)
        self.p = change @ self.p @ change.T + self.noise
        if not (math.isfinite(self.x.sum()) and 0.0 < self.x[1] < math.pi and math.isfinite(self.p.sum())):
            self.reset()

    def _moved(
        self, act: float, q: float, v: float, torque: float, share: float, recruitment: float
    ) -> tuple[float, float, float]:
        """Activation, angle and rate a pulse later: steps of the midpoint rule, activation exact."""
        d, h = self.dynamics, PULSE_S / STEPS
        fade, half = math.exp(-h / d.time_constant), math.exp(-0.5 * h / d.time_constant)
        pull, inverse, damping, moved = d.pull_nm * share, 1.0 / d.inertia, d.damping, d.moved
        for _ in range(STEPS):
            now = moved(q, pull * act) + torque - damping * v
            middle_q, middle_v = q + 0.5 * h * v, v + 0.5 * h * now * inverse
            now = moved(middle_q, pull * (recruitment + (act - recruitment) * half)) + torque - damping * middle_v
            q, v, act = q + h * middle_v, v + h * now * inverse, recruitment + (act - recruitment) * fade
        return act, q, v

    def _bound(self) -> None:
        self.x[0] = min(max(self.x[0], 0.0), 1.0)
        self.x[4] = min(max(self.x[4], LEAST_SHARE), MOST_SHARE)
        if self.p[4, 4] > 0.09:  # what is never used is never seen: its doubt stays at 30 %
            scale = 0.3 / math.sqrt(self.p[4, 4])
            self.p[4] *= scale
            self.p[:, 4] *= scale
