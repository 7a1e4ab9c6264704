"""Causes in the sensor, and causes that no library has."""

# ruff: noqa: RUF012  (class attributes that nothing changes)
from __future__ import annotations

import math

import numpy as np
from scipy.interpolate import CubicSpline

from confusion_matrix.form import Form, Signed, play

ALL = ("ankle", "joint", "muscle")
BOTH = ("ankle", "joint")


class Offset(Signed):
    cause, rigs, unit, cap = "sensor_offset", ALL, 1e-3, 20.0
    true = {"offset": "size"}

    def reading(self, y, v, time, rest):
        return y + self.size * self.p["sign"]


class _Deviating(Signed):
    """Deviations from a trial's rest; on a joint from there, from where it hangs or from zero."""

    @classmethod
    def draw(cls, rng, angles):
        return {**super().draw(rng, angles), "place": float(rng.integers(3))}

    def begin(self, s, lanes):
        self.lanes = lanes

    def rest_of(self, rest):
        if self.lanes.rig != "joint":
            return rest
        hanging = np.arctan2(-self.lanes.k["gravity_cos"], self.lanes.k["gravity_sin"])
        return np.choose(self.p["place"].astype(int), (rest, hanging, 0.0 * rest))


class Gain(_Deviating):
    cause, rigs, unit, cap = "sensor_gain", BOTH, 0.02, 0.6
    true = {"error": "size"}

    def reading(self, y, v, time, rest):
        rest = self.rest_of(rest)
        return rest + (1.0 + self.size * self.p["sign"]) * (y - rest)


class Drift(Signed):
    cause, rigs, unit, cap = "sensor_drift", ALL, 2e-4, 5.0
    true = {"rate_per_s": "size"}

    def reading(self, y, v, time, rest):
        return y + self.size * self.p["sign"] * time[:, None]


class SettlingDrift(Drift):
    name = "settling"

    def reading(self, y, v, time, rest):
        return y + self.size * self.p["sign"] * (5.0 * -np.expm1(-time / 5.0))[:, None]


class LowPass(Form):
    cause, rigs, unit, cap, states = "sensor_lag", ALL, 0.003, 0.08, ("read",)
    true = {"lag_s": "size"}

    def rest(self, name, q):
        return q

    def rates(self, s):
        return {"read": (s.force_or_angle - self.own(s, "read")) / np.maximum(self.size, 4e-4)}

    def sensed(self, y, s):
        return np.where(s.moving | (s.rig == "muscle"), self.own(s, "read"), y)


class TimeShift(LowPass):
    name, states = "time_shift", ()

    def sensed(self, y, s):
        return y

    def reading(self, y, v, time, rest):
        out = np.empty_like(y)
        for lane, late in enumerate(self.size):
            past = CubicSpline(time, y[:, lane])(np.maximum(time - late, 0.0))
            out[:, lane] = np.where(time < late, y[0, lane], past)
        return out


class Curved(_Deviating):
    cause, rigs, unit, cap = "sensor_nonlinearity", BOTH, 0.05, 1.2
    true = {"curvature": "size"}

    def reading(self, y, v, time, rest):
        return y + self.size * self.p["sign"] * (y - self.rest_of(rest)) ** 2


class CurvedMore(Curved):
    name = "exponential"

    def reading(self, y, v, time, rest):
        away, sign = y - self.rest_of(rest), self.p["sign"]
        return y + self.size * sign * (np.expm1(3.0 * away) - 3.0 * away) / 4.5


class Hum(Form):
    cause, rigs, unit, cap = "mains_hum", ALL, 3e-4, 5.0
    true = {"in_phase": "in_phase", "quadrature": "quadrature"}

    @classmethod
    def draw(cls, rng, angles):
        return {"hz": float(rng.choice((50.0, 60.0))), "phase": float(rng.uniform(0.0, 2.0 * math.pi))}

    def reading(self, y, v, time, rest):
        return y + self.size * np.sin(2.0 * math.pi * self.p["hz"] * time[:, None] + self.p["phase"])


class HumUnlocked(Hum):
    """Each trial begins at another phase of the mains."""

    name = "own_phase"

    def begin(self, s, lanes):
        self.number = lanes.k["number"]

    def reading(self, y, v, time, rest):
        phase = self.p["phase"] + 2.399963 * self.number
        return y + self.size * np.sin(2.0 * math.pi * self.p["hz"] * time[:, None] + phase)


class Detents(Form):
    cause, name, unit, cap = "detents", "outside", 0.003, 0.08

    def torque(self, torque, s):
        return torque - self.size * np.sin(2.0 * math.pi * s.q / 0.06)


class DriftingDamping(Form):
    cause, name, unit, cap = "drifting_damping", "outside", 0.05, 3.0

    def torque(self, torque, s):
        return torque - self.size * s.k["damping"] * s.t * s.v


class Spasms(Form):
    """Three pulls of 0.3 s at random times of each trial."""

    cause, name, unit, cap = "spasms", "outside", 0.004, 0.3

    @classmethod
    def draw(cls, rng, angles):
        return {"seed": float(rng.integers(0, 2**31))}

    def begin(self, s, lanes):
        drawn = zip(self.p["seed"], lanes.k["number"], strict=True)
        self.at = np.array([np.random.default_rng([int(x), int(i)]).uniform(0.5, 7.2, 3) for x, i in drawn]).T

    def torque(self, torque, s):
        inside = np.clip((s.t - self.at) / 0.3, 0.0, 1.0)
        return torque + self.size * np.sum(np.sin(math.pi * inside) ** 2, axis=0)


class PulseRipple(Form):
    """Force that is not fused: it ripples with the pulses, 12.5 Hz so that the joint can follow."""

    cause, name, unit, cap = "pulse_ripple", "outside", 0.05, 0.9

    def force(self, force, s):
        return force * (1.0 + self.size * math.sin(2.0 * math.pi * 12.5 * s.t))


class SensorBacklash(Form):
    cause, name, unit, cap = "sensor_backlash", "outside", 1e-3, 0.1

    def reading(self, y, v, time, rest):
        return play(y, self.size, rest)


class SensorSlip(Form):
    """The sensor slips once in a trial, at a time of its own, to a new zero."""

    cause, name, unit, cap = "sensor_slip", "outside", 1e-3, 0.2

    def begin(self, s, lanes):
        self.number = lanes.k["number"]

    def reading(self, y, v, time, rest):
        at = 2.0 + 4.5 * np.mod(0.618034 * (1.0 + self.number), 1.0)
        return y + self.size * (time[:, None] > at)


FORMS: tuple[type[Form], ...] = (
    *(Offset, Gain, Drift, SettlingDrift, LowPass, TimeShift, Curved, CurvedMore, Hum, HumUnlocked),
    *(Detents, DriftingDamping, Spasms, PulseRipple, SensorBacklash, SensorSlip),
)
