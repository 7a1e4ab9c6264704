"""The paper's ankle: nerve, muscle and one joint with a load on a cable, or on a dynamometer."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from fes_pin.data.channels import RATE, VOLUNTARY, recruitment_keys
from fes_pin.data.imposed import imposed_motion
from fes_pin.data.schema import IMPOSED, START_S, RigSchema, any_number, not_negative, positive
from fes_pin.data.stimulus import is_stimulated
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.models.least_squares import least_squares
from fes_pin.models.maths import cos, exp, ramp, sin, where
from fes_pin.models.rigs.base import GRAVITY, IMPOSED_STOPPING, Rig, imposed_now, stated
from fes_pin.models.rigs.rigid import gravity_coefficients, point_foot
from fes_pin.models.rigs.stimuli import at_start, recruited_in, recruited_now, rest_muscle, usual_period
from fes_pin.models.stage import Signals, parameter

UPRIGHT = 1.5707963267948966
"""The angle of the largest lever, pi/2 rad, where the muscle's length counts as its reference."""


@dataclass(frozen=True)
class Ankle(Rig):
    """An ankle moved by a stimulated muscle against a load; Dombre, Fournier and Coiffet, section II.

        r            = clip((w - threshold) / (saturation - threshold), 0, 1)
        tau da/dt    = r - a
        F_M          = K F_ref a
        F_ANT(theta) = f0 (exp(f1 (theta - theta_r)) - 1), 0 below theta_r
        J theta''    = (a_arm F_M - l (F_ANT - M g)) sin(theta) + m g l cos(theta) - xi theta'        eq. (1)

    A motion trial starts at rest and unstimulated, at the static equilibrium of its load. The foot's gravity torque
    comes from Pinocchio, as A cos(theta) + B sin(theta).

    Where a dynamometer imposes the motion its reading is what the ankle exerts on it, the right-hand side of eq. (1)
    less J theta'', positive where the muscle pulls; `torque_sign` -1 where it counts the other way, as a muscle that
    would push gives away. It holds no load but one that is stated.
    """

    gain: float = parameter(0.65, lower=1e-3, upper=100.0, scale=0.1)
    time_constant_s: float = parameter(0.05, unit="s", lower=2e-3, upper=2.0, scale=0.01)
    inertia_kgm2: float = parameter(1e-3, unit="kg m2", lower=1e-6, upper=10.0, scale=2e-4)
    damping_nms: float = parameter(0.06, unit="N m s", lower=0.0, upper=100.0, scale=0.01)

    name = "ankle"
    settings = ("--set load_kg=1.5", "--set kind=isometric --set angle_rad=1.9", "--set kind=imposed")
    schema = RigSchema(
        constants={
            "foot_mass_kg": positive("kg"),
            "com_distance_m": positive("m"),
            "moment_arm_m": positive("m"),
            "force_scale_n": positive("N"),
            **recruitment_keys(),
        },
        passive={"f0_n": not_negative("N"), "f1_per_rad": not_negative("1/rad"), "theta_r_rad": any_number("rad")},
        start={
            "gain": positive(""),
            "time_constant_s": positive("s"),
            "inertia_kgm2": positive("kg m2"),
            "damping_nms": not_negative("N m s"),
        },
        conditions={"load_kg": not_negative("kg", False), "angle_rad": any_number("rad", False), **START_S},
        needed={
            "motion": {"load_kg": "the load in kg, as this is a motion trial"},
            "isometric": {"angle_rad": "the angle in rad that this isometric trial is held at"},
        },
        only={"angle_rad": "isometric"},
        default_kind="motion",
        outputs={"motion": "angle_rad", "isometric": "force_n", IMPOSED: "torque_nm"},
        inputs=("pulse_width_us", "amplitude_ma", "charge_uc", RATE, *VOLUNTARY),
        imposed=("angle_rad",),
    )
    needed = (*(n for n, number in schema.constants.items() if number.required), *schema.passive)

    def decay_s(self) -> float:
        return self.inertia_kgm2 / self.damping_nms if self.damping_nms > 0.0 else math.inf

    @classmethod
    def of_study(cls, study: Study) -> "Ankle":
        start: dict[str, Any] = dict(study.start)
        acting = [t for t in study.trials if is_stimulated(t)]
        fitted = None if acting else ("inertia_kgm2", "damping_nms")
        plain = cls(constants={**study.constants, **usual_period(study.trials)}, fitted=fitted, **start)
        measured = [t for t in study.trials if t.kind == IMPOSED and "torque_nm" in t]
        if not measured or not acting or plain.pull_in(measured) >= 0.0:
            return plain
        return cls(constants={**plain.constants, "torque_sign": -1.0}, fitted=fitted, **start)

    @classmethod
    def conditions_to_try(cls, study: Study) -> set[tuple[str, tuple[tuple[str, float], ...]]]:
        """Those of the study, half and once and a half its loads, and angles held where it has moved."""
        seen = super().conditions_to_try(study)
        moved = np.concatenate([[], *(t["angle_rad"] for t in study.trials if t.kind == "motion" and "angle_rad" in t)])
        out = set(seen)
        for kind, conditions in seen:
            values, others = dict(conditions), {}
            if "load_kg" in values:
                others["load_kg"] = [factor * values["load_kg"] for factor in (0.5, 1.5)]
            elif "angle_rad" in values and moved.size:
                others["angle_rad"] = list(np.quantile(moved, (0.05, 0.95)))
            for name, many in others.items():
                out |= {(kind, tuple(sorted({**values, name: round(float(v), 3)}.items()))) for v in many}
        return out

    def signals(self, kind: str) -> tuple[str, ...]:
        muscle = ("pulse_width", "recruitment", "delay", "time_constant", "activation", "fibres", "force", "pull")
        joint = ("load", "net_force", "gravity_angle", "torque", "friction")
        moved = {"motion": (*joint, "driving", "acceleration", "reading"), IMPOSED: (*joint, "reading")}
        return (*muscle, *moved.get(kind, ()))

    def changeable(self, kind: str, inputs: tuple[str, ...]) -> tuple[str, ...]:
        return self.driven_signals(self.signals(kind), inputs)

    def states(self, kind: str) -> tuple[str, ...]:
        return ("act", "q", "v") if kind == "motion" else ("act",)

    def memories(self, kind: str) -> tuple[str, ...]:
        return ("r", "r_before", "rest") if kind == "motion" else ("r", "r_before")

    def constant_names(self, kind: str) -> tuple[str, ...]:
        own = {"motion": ("load_kg",), "isometric": ("angle_rad",), IMPOSED: ("load_kg", "torque_sign")}
        period = ("pulse_period_s",) if "pulse_period_s" in self.constants else ()
        known = (*(n for n in self.needed if n not in self.schema.passive), *self.ends(), *self.schema.passive)
        return (*known, *period, "gravity_cos", "gravity_sin", *own[kind])

    def trial_constants(self, trial: Trial) -> dict[str, float]:
        a, b = _foot_gravity(float(self.constants["foot_mass_kg"]), float(self.constants["com_distance_m"]))
        unstated = {"load_kg": 0.0, "torque_sign": 1.0} if trial.kind == IMPOSED else {}
        unstated |= {**at_start(trial), "gravity_cos": a, "gravity_sin": b}
        known = {**unstated, **self.constants, **trial.conditions}
        return stated(known, self.constant_names(trial.kind), trial)

    def recruited(self, trial: Trial) -> np.ndarray:
        return recruited_in(trial, self.channel, self.constants)

    def driving_sizes(self, trials: Sequence[Trial]) -> dict[str, float]:
        """Return the torque of the cable in a free motion at the start values."""
        if all(t.kind != IMPOSED for t in trials):
            c, moved = self.constants, [float(np.mean(self.recruited(t) ** 2)) for t in trials if t.kind == "motion"]
            size = float(self.gain * c["force_scale_n"] * c["moment_arm_m"]) * math.sqrt(max(moved, default=0.0))
            return {"effort": max(size, 1e-9)} if moved else {}
        read = {n: [t[c] for t in trials if c in t] for n, c in (("effort", "torque_nm"), ("force", "force_n"))}
        return {n: max(math.sqrt(max(float(np.nanmean(y**2)) for y in many)), 1e-9) for n, many in read.items() if many}

    def pull_in(self, trials: Sequence[Trial]) -> float:
        """Return the coefficient of the muscle's torque in a dynamometer's reading; below 0 its sign is opposite.

        The regression also contains acceleration, velocity and a parabola in the angle, close to any function of it.
        """
        c, rows, read = {n: float(self.constants[n]) for n in self.needed}, [], []
        for trial in trials:
            q, v, bend = imposed_motion(trial, self.schema.imposed).values
            act = np.asarray(self.activation(trial))
            rows.append(np.stack([c["moment_arm_m"] * act * np.sin(q), bend, v, np.ones(len(q)), q, q * q], axis=1))
            read.append(trial["torque_nm"])
        return float(least_squares(np.concatenate(rows), np.concatenate(read))[0])

    def guess(self, trial: Trial) -> float:
        return 1.75

    def set_rest(self, s: Signals, z: Any) -> None:
        for name in vars(s.x):
            setattr(s.x, name, 0.0)
        rest_muscle(s)
        if s.kind == IMPOSED:
            s.q, s.v, s.force_scale = s.c.imposed_start, 0.0, self.gain * s.c.force_scale_n
            s.sensed = s.c.torque_sign * self._joint_torque(s, s.force_scale * s.x.act)
            return
        if s.kind == "motion":
            s.x.q, s.x.v, s.m.rest = z, 0.0, z
        s.q = s.sensed = z

    def rest_residual(self, s: Signals, z: Any) -> Any:
        return s.torque if s.kind == "motion" else z

    def sample(self, s: Signals) -> dict[str, Any]:
        return {"r": s.through("recruitment", recruited_now(s, self.channel)), "r_before": s.m.r}

    def rates(self, s: Signals) -> dict[str, Any]:
        c = s.c
        s.arm, s.lever = c.moment_arm_m, c.com_distance_m
        s.force_scale = self.gain * c.force_scale_n
        s.r = s.delayed(s.m.r, s.m.r_before)
        s.q, s.v, bend = self._motion(s)
        s.act, s.sensed = s.x.act, s.q
        s.time_constant = s.through("time_constant", self.time_constant_s)
        s.act_rate = (s.r - s.act) / s.time_constant
        s.drive = s.through("activation", s.act)
        s.bent = s.q - UPRIGHT
        s.force = s.through("pull", s.through("force", s.through("fibres", s.force_scale * s.drive)))
        rates = {"act": s.act_rate}
        if s.kind == "motion":
            s.inertia = self.inertia_kgm2
            s.torque = s.through("friction", s.through("torque", self._joint_torque(s, s.force)))
            s.driving = s.through("driving", s.torque / s.inertia)
            s.acceleration = s.through("acceleration", s.driving)
            rates.update(q=s.v, v=s.acceleration)
        elif s.kind == IMPOSED:
            s.inertia, s.stopping = self.inertia_kgm2, IMPOSED_STOPPING * self.inertia_kgm2
            s.torque = s.through("friction", s.through("torque", self._joint_torque(s, s.force)))
            s.sensed = c.torque_sign * (s.torque - s.inertia * bend)
        return rates

    def _motion(self, s: Signals) -> tuple[Any, Any, Any]:
        """Angle, velocity and, where it is imposed, acceleration."""
        if s.kind == IMPOSED:
            return imposed_now(s)
        return (s.x.q, s.x.v, 0.0) if s.kind == "motion" else (s.c.angle_rad, 0.0, 0.0)

    def _joint_torque(self, s: Signals, pull: Any) -> Any:
        """The right-hand side of eq. (1): what acts on the joint under a force of the muscle."""
        c, q = s.c, s.q
        s.load = s.through("load", c.load_kg)
        s.bearing_load = 1.0  # muscle and cable press on the joint by forces that the rig does not tell
        force = s.through("net_force", pull)
        antagonist = where(q > c.theta_r_rad, c.f0_n * (exp(c.f1_per_rad * ramp(q - c.theta_r_rad)) - 1.0), 0.0)
        tilted = s.through("gravity_angle", q)
        gravity = c.gravity_cos * cos(tilted) + c.gravity_sin * sin(tilted)
        cable = c.moment_arm_m * force - c.com_distance_m * (antagonist - s.load * GRAVITY)
        return cable * sin(q) - gravity - self.damping_nms * s.v

    def readings(self, s: Signals) -> tuple[Any, ...]:
        if s.kind == "motion":
            s.rest_reading = s.idle_reading = s.m.rest
            s.sensed = s.x.q
            return (s.through("reading", s.x.q),)
        self.rates(s)
        if s.kind == IMPOSED:
            s.rest_reading = s.idle_reading = 0.0
            return (s.through("reading", s.sensed),)
        return (s.force,)


@cache
def _foot_gravity(mass: float, distance: float) -> tuple[float, float]:
    return gravity_coefficients(point_foot(mass, distance))
