"""Any rig with one joint, from its URDF: revolute or prismatic, driven by an effort or free."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fes_pin.data.trial import Trial
from fes_pin.models.maths import cos, sin, sqrt, where
from fes_pin.models.parameters import ROTARY, SLIDING, parameter
from fes_pin.models.rigs.base import Rig, first_rate
from fes_pin.models.stage import Signals

WEIGHTLESS = 1e-6
"""Gravity's torque over inertia below which a joint counts as balanced, 1/s2: a period above an hour and a half."""


@dataclass(frozen=True)
class Joint(Rig):
    """One joint with viscous damping, moved by a commanded effort or by nothing.

        inertia_scale M v' = effort - gravity_scale (A cos(q) + B sin(q)) - damping v

    M, A and B are read off Pinocchio's CRBA and gravity of the URDF (`constants`: `inertia`, `gravity_cos`,
    `gravity_sin`, `revolute`); for a prismatic joint (`revolute` 0) gravity is the constant A. The effort is held
    between samples. Each trial has its own initial position and velocity. `idle` is where it rests without an effort:
    A cos(q) + B sin(q) = 0, hanging; 0 for a prismatic joint.

    The bearing of a revolute joint carries the pull along the arm, in units of the URDF's weight at rest W (that of the
    simple pendulum with the same A, B and M; 1 for a prismatic joint, and where the joint feels no gravity):

        bearing_load = (gravity_scale d/dq (A cos(q) + B sin(q)) + inertia_scale M v^2) / W,   W^2 = A^2 + B^2
    """

    inertia_scale: float = parameter(1.0, lower=1e-3, upper=1e3, scale=0.1)
    damping: float = parameter(0.0, unit="{effort} s/{q}", lower=0.0, upper=1e4, scale=1e-3)
    gravity_scale: float = parameter(1.0, lower=-10.0, upper=10.0, scale=0.1)

    name, needed = "joint", ("inertia", "gravity_cos", "gravity_sin", "revolute")

    def units(self) -> Mapping[str, str]:
        return ROTARY if self.constants.get("revolute", 1.0) else SLIDING

    def signals(self, kind: str) -> tuple[str, ...]:
        return ("gravity_angle", "effort", "torque", "friction", "driving", "acceleration", "reading")

    def states(self, kind: str) -> tuple[str, ...]:
        return ("q", "v")

    def memories(self, kind: str) -> tuple[str, ...]:
        return ("rest",)

    def unknowns(self, kind: str) -> tuple[str, ...]:
        return ("initial_position", "initial_velocity")

    def outputs(self, kind: str) -> tuple[str, ...]:
        return ("position", "velocity")

    def input_columns(self, trial: Trial) -> tuple[str, ...]:
        return ("effort",) if "effort" in trial.columns else ()

    def constant_names(self, kind: str) -> tuple[str, ...]:
        return (*self.needed, "idle")

    def trial_constants(self, trial: Trial) -> dict[str, float]:
        known = {name: float(self.constants[name]) for name in self.needed}
        a, b = known["gravity_cos"], known["gravity_sin"]
        return {**known, "idle": math.atan2(-a, b) if known["revolute"] and (a or b) else 0.0}

    def initial_unknowns(self, trial: Trial) -> dict[str, float]:
        position, rate = first_rate(trial.time, trial["position"]) if "position" in trial.columns else (0.0, 0.0)
        if "position" in trial.columns:
            position = float(trial["position"][0])
        if "velocity" in trial.columns:
            rate = float(trial["velocity"][0])
        conditions = trial.conditions
        return {
            "initial_position": float(conditions.get("position0", position)),
            "initial_velocity": float(conditions.get("velocity0", rate)),
        }

    def unmeasured(self, trial: Trial) -> tuple[str, ...]:
        told = "velocity" in trial.columns or "velocity0" in trial.conditions
        return () if told or "position" not in trial.columns else ("initial_velocity",)

    def read_first(self, trial: Trial) -> Mapping[str, str]:
        told = "position0" in trial.conditions or "position" not in trial.columns
        return {} if told else {"initial_position": "position"}

    def set_rest(self, s: Signals, z: Any) -> None:
        s.x.q, s.x.v, s.m.rest = s.initial.initial_position, s.initial.initial_velocity, s.initial.initial_position
        s.q = s.sensed = s.x.q

    def rest_residual(self, s: Signals, z: Any) -> Any:
        return z

    def sample(self, s: Signals) -> dict[str, Any]:
        s.q = s.sensed = s.x.q
        return {}

    def rates(self, s: Signals) -> dict[str, Any]:
        c = s.c
        s.q, s.v, s.act, s.sensed = s.x.q, s.x.v, 0.0, s.x.q
        s.inertia = self.inertia_scale * c.inertia
        tilted = s.through("gravity_angle", c.revolute * s.q)
        gravity = self.gravity_scale * (c.gravity_cos * cos(tilted) + c.gravity_sin * sin(tilted))
        pull = self.gravity_scale * (c.gravity_sin * cos(tilted) - c.gravity_cos * sin(tilted)) + s.inertia * s.v * s.v
        weight = sqrt(c.gravity_cos * c.gravity_cos + c.gravity_sin * c.gravity_sin)
        swings = where(weight > WEIGHTLESS * c.inertia, c.revolute, 0.0)
        s.bearing_load = 1.0 + swings * (pull / where(swings > 0.0, weight, 1.0) - 1.0)
        effort = s.through("effort", getattr(s.u, "effort", 0.0))
        s.torque = s.through("friction", s.through("torque", effort - gravity - self.damping * s.v))
        s.driving = s.through("driving", s.torque / s.inertia)
        s.acceleration = s.through("acceleration", s.driving)
        return {"q": s.v, "v": s.acceleration}

    def readings(self, s: Signals) -> tuple[Any, ...]:
        s.rest_reading, s.idle_reading, s.sensed = s.m.rest, s.c.idle, s.x.q
        return s.through("reading", s.x.q), s.x.v
