"""Causes at the joint."""

# ruff: noqa: RUF012  (class attributes that nothing changes)
from __future__ import annotations

import numpy as np

from confusion_matrix.form import Form, play

BOTH = ("ankle", "joint")


class Friction(Form):
    cause, rigs, unit, cap, fine = "coulomb_friction", BOTH, 0.003, 0.06, 20
    true = {"torque_nm": "size"}

    def torque(self, torque, s):
        creep = 0.002 + self.size * s.h / (2.0 * s.k["inertia"])
        return torque - self.size * np.tanh(s.v / creep)


class Stiction(Friction):
    name = "stribeck"

    def torque(self, torque, s):
        creep = 0.006 + 1.5 * self.size * s.h / (2.0 * s.k["inertia"])
        more = 1.0 + 0.5 * np.exp(-np.abs(s.v) / 0.3)
        return torque - self.size * more * s.v / np.sqrt(s.v**2 + creep**2)


class Drag(Form):
    cause, rigs, unit, cap = "quadratic_damping", BOTH, 0.005, 0.08
    true = {"coefficient": "size"}

    def torque(self, torque, s):
        return torque - self.size * s.v * np.abs(s.v)


class SteeperDrag(Drag):
    name = "power_2.4"

    def torque(self, torque, s):
        return torque - self.size * s.v * np.abs(s.v) ** 1.4


class Stop(Form):
    cause, rigs, unit, cap = "joint_stop", BOTH, 0.3, 20.0
    true = {"stiffness": "size", "angle_rad": "angle"}

    @classmethod
    def draw(cls, rng, angles):
        return {"angle": float(np.quantile(angles, rng.uniform(0.8, 0.95)))}

    def torque(self, torque, s):
        return torque - self.size * np.maximum(s.q - self.p["angle"], 0.0)


class QuadraticStop(Stop):
    name, cap = "quadratic", 200.0

    def torque(self, torque, s):
        depth = np.maximum(s.q - self.p["angle"], 0.0)
        return torque - 10.0 * self.size * depth**2


class Spring(Form):
    cause, rigs, unit, cap = "parallel_stiffness", BOTH, 0.05, 3.0
    true = {"stiffness_nm_per_rad": "size", "rest_angle_rad": "angle"}

    @classmethod
    def draw(cls, rng, angles):
        return {"angle": float(np.quantile(angles, rng.uniform(0.2, 0.8)))}

    def torque(self, torque, s):
        return torque - self.size * (s.q - self.p["angle"])


class HardeningSpring(Spring):
    name = "hardening"

    def torque(self, torque, s):
        away = s.q - self.p["angle"]
        return torque - self.size * away * (1.0 + 4.0 * away**2)


class Maxwell(Form):
    cause, rigs, unit, cap, states = "passive_relaxation", BOTH, 0.05, 2.0, ("relaxed",)
    true = {"stiffness_nm_per_rad": "size", "relaxation_s": "time"}
    ranges = {"time": (0.2, 0.6)}

    def rest(self, name, q):
        return q

    def rates(self, s):
        return {"relaxed": (s.q - self.own(s, "relaxed")) / self.p["time"]}

    def torque(self, torque, s):
        return torque - self.size * (s.q - self.own(s, "relaxed"))


class TwoMaxwell(Maxwell):
    name, states = "two_elements", ("relaxed", "slow")

    def rates(self, s):
        slow = (s.q - self.own(s, "slow")) / (5.0 * self.p["time"])
        return {**super().rates(s), "slow": slow}

    def torque(self, torque, s):
        return torque - self.size * (1.5 * s.q - self.own(s, "relaxed") - 0.5 * self.own(s, "slow"))


class LoadInertia(Form):
    cause, unit, cap = "load_inertia", 0.1, 3.0
    true = {"share": "size"}

    def accelerate(self, acceleration, s):
        moved, j = self.size * s.load * s.k["com_distance_m"] ** 2, s.k["inertia"]
        sine, cosine = np.sin(s.q), np.cos(s.q)
        return (acceleration * j - moved * sine * cosine * s.v**2) / (j + moved * sine**2)


class PulleyInertia(LoadInertia):
    name = "pulley"

    def accelerate(self, acceleration, s):
        moved, j = self.size * s.load * s.k["com_distance_m"] ** 2, s.k["inertia"]
        return acceleration * j / (j + moved)


class Reflex(Form):
    cause, unit, cap, states = "stretch_reflex", 0.005, 0.06, ("follow", "change")
    true = {"gain_nms": "size", "delay_s": "delay"}

    @classmethod
    def draw(cls, rng, angles):
        return {"delay": float(rng.uniform(0.035, 0.06)), "side": float(rng.choice((-1.0, 1.0), p=(0.3, 0.7)))}

    def rates(self, s):
        pace, change = 1.0 / self.p["delay"], self.own(s, "change")
        return {"follow": change, "change": 12.0 * pace**2 * (s.v - self.own(s, "follow")) - 6.0 * pace * change}

    def torque(self, torque, s):
        late = s.v - self.p["delay"] * self.own(s, "change")
        return torque - self.p["side"] * self.size * np.maximum(self.p["side"] * late, 0.0)


class PureReflex(Reflex):
    name, states = "pure_delay", ()

    def begin(self, s, lanes):
        self.back = np.maximum(np.round(self.p["delay"] / s.h).astype(int), 1)
        self.past = np.zeros((int(self.back.max()) + 1, len(self.size)))
        self.late = np.zeros(len(self.size))

    def passed(self, v, step):
        self.past[step % len(self.past)] = v
        self.late = self.past[(step - self.back) % len(self.past), np.arange(len(v))]

    def torque(self, torque, s):
        return torque - self.p["side"] * self.size * np.maximum(self.p["side"] * self.late, 0.0)


class Cogging(Form):
    cause, rigs, unit, cap = "cogging", ("joint",), 0.005, 0.5
    true = {"in_phase": "in_phase", "quadrature": "quadrature", "waves": "waves"}

    @classmethod
    def draw(cls, rng, angles):
        waves = 2.0 * np.pi * rng.uniform(4.0, 12.0) / max(float(np.ptp(angles)), 1e-3)
        return {"waves": float(waves), "phase": float(rng.uniform(0.0, 2.0 * np.pi))}

    def torque(self, torque, s):
        return torque + self.size * np.sin(self.p["waves"] * s.q + self.p["phase"])


class Detented(Cogging):
    """Between two detents the torque rises slowly and falls fast."""

    name = "sawtooth"

    def torque(self, torque, s):
        angle = self.p["waves"] * s.q + self.p["phase"]
        return torque + self.size * (np.sin(angle) + 0.4 * np.sin(2.0 * angle) + 0.15 * np.sin(3.0 * angle))


class Backlash(Form):
    cause, rigs, unit, cap = "backlash", ("joint",), 0.003, 0.2
    true = {"half_width": "size"}

    def reading(self, y, v, time, rest):
        return play(y, self.size, rest)


class WornBacklash(Backlash):
    """Half of the slack is taken up softly: two plays of other widths, side by side."""

    name = "two_plays"

    def reading(self, y, v, time, rest):
        return 0.5 * (play(y, 0.5 * self.size, rest) + play(y, 1.5 * self.size, rest))


FORMS: tuple[type[Form], ...] = (
    *(Friction, Stiction, Drag, SteeperDrag, Stop, QuadraticStop, Spring, HardeningSpring, Maxwell, TwoMaxwell),
    *(LoadInertia, PulleyInertia, Reflex, PureReflex, Cogging, Detented, Backlash, WornBacklash),
)
