"""Causes in the rig: what holds the joint, drives it and loads it."""

# ruff: noqa: RUF012  (class attributes that nothing changes)
from __future__ import annotations

import math

import numpy as np

from confusion_matrix.form import Form, Signed

BOTH = ("ankle", "joint")


class EffortOffset(Signed):
    cause, rigs, unit, cap = "effort_offset", ("joint",), 0.005, 0.5
    true = {"offset": "size"}

    def begin(self, s, lanes):
        s.offset = s.offset + self.size * self.p["sign"]


class EffortGain(Signed):
    cause, rigs, unit, cap = "effort_gain", ("joint",), 0.05, 0.9
    true = {"error": "size"}

    def begin(self, s, lanes):
        s.effort = s.effort * (1.0 + self.size * self.p["sign"])


class EffortSaturates(EffortGain):
    """A gain that is lower, the lower the larger the effort."""

    name, cap = "saturating", 0.5

    @classmethod
    def draw(cls, rng, angles):
        return {"sign": -1.0}

    def begin(self, s, lanes):
        share = np.abs(s.effort) / np.maximum(np.abs(s.effort).max(axis=0), 1e-9)
        s.effort = s.effort * (1.0 - self.size * (0.8 + 0.4 * share))


class Tilt(Signed):
    cause, rigs, unit, cap = "base_tilt", BOTH, 0.02, 0.5
    true = {"tilt_rad": "size"}

    def begin(self, s, lanes):
        s.tilt = s.tilt + self.size * self.p["sign"]


class LoadError(Signed):
    cause, unit, cap = "load_error", 0.003, 0.3
    true = {"error": "size"}

    def begin(self, s, lanes):
        s.load = s.load * (1.0 + self.size * self.p["sign"])


class Frame(Form):
    cause, rigs, unit, cap, states = "frame_vibration", BOTH, 0.05, 1.0, ("phi", "rate")
    true = {"coupling": "size", "frequency_hz": "hz", "damping_ratio": "zeta"}
    ranges = {"hz": (6.0, 14.0), "zeta": (0.03, 0.08)}

    def accelerate(self, acceleration, s):
        omega = 2.0 * math.pi * self.p["hz"]
        spring = omega**2 * self.own(s, "phi") + 2.0 * self.p["zeta"] * omega * self.own(s, "rate")
        self.swing = -spring - self.size * acceleration
        return acceleration - self.swing

    def rates(self, s):
        return {"phi": self.own(s, "rate"), "rate": self.swing * s.moving}


class FrameSeen(Frame):
    """The sensor sees part of the frame's own swing beside the joint's angle."""

    name = "sensor_on_frame"

    def sensed(self, y, s):
        return y + 0.3 * self.own(s, "phi")


class Breathing(Form):
    cause, rigs, unit, cap = "periodic_torque", BOTH, 0.002, 0.2
    true = {"in_phase": "in_phase", "quadrature": "quadrature", "frequency_hz": "hz"}
    ranges = {"hz": (0.2, 0.5), "phase": (0.0, 2.0 * math.pi)}

    def torque(self, torque, s):
        return torque + self.size * np.sin(2.0 * math.pi * self.p["hz"] * s.t + self.p["phase"])


class BreathingWithHarmonic(Breathing):
    name = "harmonic"

    def torque(self, torque, s):
        phase = 2.0 * math.pi * self.p["hz"] * s.t + self.p["phase"]
        return torque + self.size * (np.sin(phase) + 0.3 * np.sin(2.0 * phase + 1.0))


class BreathingUnlocked(BreathingWithHarmonic):
    """Each trial begins at another phase."""

    name = "own_phase"

    def begin(self, s, lanes):
        self.begins = self.p["phase"] + 2.399963 * lanes.k["number"]

    def torque(self, torque, s):
        return torque + self.size * np.sin(2.0 * math.pi * self.p["hz"] * s.t + self.begins)


FORMS: tuple[type[Form], ...] = (
    *(
        EffortOffset,
        EffortGain,
        EffortSaturates,
        Tilt,
        LoadError,
        Frame,
        FrameSeen,
        Breathing,
        BreathingWithHarmonic,
        BreathingUnlocked,
    ),
)
