"""Causes in the muscle."""

# ruff: noqa: RUF012  (class attributes that nothing changes)
from __future__ import annotations

import math

import numpy as np

from confusion_matrix.form import Form, Signed

BOTH = ("ankle", "muscle")


class Fatigue(Form):
    cause, rigs, unit, cap, states = "fatigue", BOTH, 0.01, 0.4, ("capacity",)
    true = {"rate_per_s": "size", "recovery_s": "recovery"}
    ranges = {"recovery": (15.0, 40.0)}

    def rest(self, name, q):
        return 1.0

    def rates(self, s):
        c = self.own(s, "capacity")
        return {"capacity": (1.0 - c) / self.p["recovery"] - self.size * s.act * (c - 0.35)}

    def force(self, force, s):
        return force * self.own(s, "capacity")


class DingFatigue(Fatigue):
    name = "ding"

    def rates(self, s):
        c = self.own(s, "capacity")
        return {"capacity": (1.0 - c) / self.p["recovery"] - self.size * s.act}


class TwoPools(Fatigue):
    name, states = "two_pools", ("fast", "slow")

    def rates(self, s):
        fast, slow = self.own(s, "fast"), self.own(s, "slow")
        return {
            "fast": (1.0 - fast) / (0.4 * self.p["recovery"]) - 1.6 * self.size * s.act * fast,
            "slow": (1.0 - slow) / (2.0 * self.p["recovery"]) - 0.4 * self.size * s.act * slow,
        }

    def force(self, force, s):
        return force * (0.6 * self.own(s, "fast") + 0.4 * self.own(s, "slow"))


class Potentiation(Form):
    cause, rigs, unit, cap, states = "potentiation", BOTH, 0.03, 1.0, ("level",)
    true = {"gain": "size", "decay_s": "decay"}
    ranges = {"decay": (1.5, 4.0)}

    def rates(self, s):
        return {"level": (s.act - self.own(s, "level")) / self.p["decay"]}

    def force(self, force, s):
        return force * (1.0 + self.size * self.own(s, "level"))


class SaturatingPotentiation(Potentiation):
    name = "saturating"

    def force(self, force, s):
        return force * (1.0 + self.size * np.tanh(2.5 * self.own(s, "level")))


class Delay(Form):
    cause, rigs, unit, cap = "electromechanical_delay", BOTH, 0.004, 0.08
    true = {"delay_s": "size"}

    def delays(self):
        return [(1.0, self.size)]


class DispersedDelay(Delay):
    name = "dispersed"

    def delays(self):
        return [(0.5, 0.7 * self.size), (0.5, 1.3 * self.size)]


class SecondLag(Form):
    cause, rigs, unit, cap, states = "second_order_activation", BOTH, 0.004, 0.05, ("second",)
    true = {"second_s": "size"}

    def rates(self, s):
        return {"second": (s.act - self.own(s, "second")) / np.maximum(self.size, 4.0 * s.h / 10.0)}

    def activation(self, act, s):
        return self.own(s, "second")


class TwoFibreLags(SecondLag):
    """Half of the fibres lag shortly, half longer."""

    name, states = "two_fibres", ("short", "long")

    def rates(self, s):
        size = np.maximum(self.size, 1e-3)
        return {
            "short": (s.act - self.own(s, "short")) / (0.6 * size),
            "long": (s.act - self.own(s, "long")) / (1.4 * size),
        }

    def activation(self, act, s):
        return 0.5 * (self.own(s, "short") + self.own(s, "long"))


class Asymmetry(Signed):
    cause, rigs, unit, cap = "rise_fall_asymmetry", BOTH, 0.1, 1.5
    ways = (0.3, 0.7)
    true = {"log_ratio": "size"}

    def time_constant(self, tau, s):
        return tau * np.where(s.r < s.act, np.exp(self.size * self.p["sign"]), 1.0)


class SmoothAsymmetry(Asymmetry):
    name = "smooth"

    def time_constant(self, tau, s):
        falls = 0.5 * (1.0 + np.tanh((s.act - s.r) / 0.1))
        return tau * (1.0 + (np.exp(self.size * self.p["sign"]) - 1.0) * falls)


class ForceLength(Form):
    cause, unit, cap = "force_length", 0.1, 4.0
    ranges = {"best": (1.5, 2.1)}

    @classmethod
    def truth(cls, size, p):
        away = p["best"] - math.pi / 2
        return {"slope_per_rad": 2.0 * size * away, "curvature_per_rad2": size}

    def force(self, force, s):
        return force * np.exp(-self.size * (s.q - self.p["best"]) ** 2)


class Parabola(ForceLength):
    name = "parabola"

    def force(self, force, s):
        return force * np.maximum(1.0 - self.size * (s.q - self.p["best"]) ** 2, 0.05)


class ForceVelocity(Form):
    cause, unit, cap = "force_velocity", 0.03, 0.6
    true = {"slope_s_per_rad": "size"}

    def force(self, force, s):
        return force * (1.0 - self.size * s.v * s.moving)


class HillForceVelocity(ForceVelocity):
    """Hill's hyperbola when shortening, its mirror up to 1.4 when lengthening."""

    name = "hill"

    def force(self, force, s):
        v = self.size * s.v * s.moving
        shortening = np.maximum(1.0 - 0.25 * np.maximum(v, 0.0), 0.0) / (1.0 + 0.75 * np.maximum(v, 0.0))
        return force * np.where(v > 0.0, shortening, 1.0 + 0.4 * np.tanh(-np.minimum(v, 0.0) / 0.4))


FORMS: tuple[type[Form], ...] = (
    *(Fatigue, DingFatigue, TwoPools, Potentiation, SaturatingPotentiation, Delay, DispersedDelay, SecondLag),
    *(TwoFibreLags, Asymmetry, SmoothAsymmetry, ForceLength, Parabola, ForceVelocity, HillForceVelocity),
)
