"""Causes in the nerve."""

# ruff: noqa: RUF012  (class attributes that nothing changes)
from __future__ import annotations

import math

import numpy as np

from confusion_matrix.form import Form, Signed, play

BOTH = ("ankle", "muscle")


class Shift(Signed):
    cause, rigs, unit, cap = "threshold_shift", BOTH, 10.0, 150.0
    true = {"shift_us": "size"}

    def width(self, w, time, lanes):
        return w - self.size * self.p["sign"]


class ShiftMoreAtSaturation(Shift):
    name = "wider"

    def width(self, w, time, lanes):
        k = lanes.k
        share = np.clip((w - k["threshold_us"]) / (k["saturation_us"] - k["threshold_us"]), 0.0, 1.0)
        return w - self.size * self.p["sign"] * (1.0 + 0.25 * share)


class HillRecruitment(Form):
    cause, rigs, unit, cap = "recruitment_curvature", BOTH, 0.1, 1.5
    ranges = {"bend": (-1.0, 2.0)}

    @classmethod
    def truth(cls, size, p):
        return {"log_exponent": size, "log_bend": size * p["bend"]}

    def recruit(self, r):
        power, bend = r ** np.exp(self.size), np.exp(self.size * self.p["bend"])
        return bend * power / (1.0 + (bend - 1.0) * power)


class DingRecruitment(Form):
    cause, name, rigs, unit, cap = "recruitment_curvature", "ding", BOTH, 0.3, 8.0

    def recruit(self, r):
        return np.expm1(-self.size * r) / np.expm1(-self.size)


class GompertzRecruitment(Form):
    cause, name, rigs, unit, cap = "recruitment_curvature", "gompertz", BOTH, 0.1, 1.0
    ranges = {"delay": (2.0, 4.0), "steepness": (3.0, 5.0)}

    def recruit(self, r):
        b, c = self.p["delay"], self.p["steepness"]
        low, high = np.exp(-b), np.exp(-b * np.exp(-c))
        return (1.0 - self.size) * r + self.size * (np.exp(-b * np.exp(-c * r)) - low) / (high - low)


class Play(Form):
    cause, rigs, unit, cap = "recruitment_hysteresis", BOTH, 5.0, 150.0
    true = {"half_width_us": "size"}

    def width(self, w, time, lanes):
        return play(w, self.size, 0.0 * w[0])


class TwoPlays(Form):
    cause, name, rigs, unit, cap = "recruitment_hysteresis", "two_plays", BOTH, 5.0, 150.0

    def width(self, w, time, lanes):
        return 0.5 * (play(w, 0.5 * self.size, 0.0 * w[0]) + play(w, 1.5 * self.size, 0.0 * w[0]))


class ThresholdDrift(Signed):
    cause, rigs, unit, cap = "threshold_drift", BOTH, 1.0, 40.0
    ways = (0.3, 0.7)
    true = {"rate_us_per_s": "size"}

    def width(self, w, time, lanes):
        return w - self.size * self.p["sign"] * time[:, None]


class SettlingThreshold(ThresholdDrift):
    name = "settling"

    def width(self, w, time, lanes):
        return w - self.size * self.p["sign"] * (5.0 * -np.expm1(-time / 5.0))[:, None]


class Spillover(Form):
    cause, unit, cap = "antagonist_spillover", 0.05, 1.0
    true = {"share": "size", "onset_us": "onset"}
    ranges = {"onset": (450.0, 650.0)}

    def begin(self, s, lanes):
        room = (lanes.input - self.p["onset"]) / (lanes.k["saturation_us"] - self.p["onset"])
        self.spilt = self.size * lanes.k["strength"] * self.shape(room)

    def shape(self, room):
        return np.clip(room, 0.0, 1.0)

    def net_force(self, force, s):
        return force - self.spilt[min(int(s.t / 0.005 + 1e-6), len(self.spilt) - 1)]


class LaggedSpillover(Spillover):
    name, states = "smooth_lagged", ("pulled",)

    def shape(self, room):
        return np.log1p(np.exp(np.minimum(10.0 * room, 30.0))) / math.log1p(math.exp(10.0)) * (room > -1.0)

    def rates(self, s):
        now = self.spilt[min(int(s.t / 0.005 + 1e-6), len(self.spilt) - 1)]
        return {"pulled": (now - self.own(s, "pulled")) / s.k["time_constant"]}

    def net_force(self, force, s):
        return force - self.own(s, "pulled")


FORMS: tuple[type[Form], ...] = (
    *(Shift, ShiftMoreAtSaturation, HillRecruitment, DingRecruitment, GompertzRecruitment, Play, TwoPlays),
    *(ThresholdDrift, SettlingThreshold, Spillover, LaggedSpillover),
)
