"""Any rig with one joint, from its URDF: revolute or prismatic, driven by an effort or free."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.schema import IMPOSED, START_S, NumberKey, RigSchema, any_number, not_negative, positive
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.data.urdf import check_one_joint, stated_of_joint
from fes_pin.models.effects.coulomb_friction import STATED, CoulombFriction, FrictionBeyond
from fes_pin.models.maths import cos, sin, sqrt, where
from fes_pin.models.parameters import ROTARY, SLIDING, parameter
from fes_pin.models.rigs.base import IMPOSED_STOPPING, RUN_OUT, Rig, first_rate, imposed_now, undone
from fes_pin.models.rigs.rigid import gravity_coefficients, joint_inertia, joint_is_revolute, load_urdf
from fes_pin.models.stage import Signals

WEIGHTLESS = 1e-6
"""Gravity's torque over inertia below which a joint counts as balanced, 1/s2: a period above an hour and a half."""


def _check_urdf(files: Mapping[str, Path]) -> None:
    check_one_joint(files["urdf"])


def _stated(files: Mapping[str, Path]) -> dict[str, float]:
    """Return the start value that a URDF states: of the damping."""
    stated = stated_of_joint(files["urdf"]) if "urdf" in files else {}
    return {"damping": stated["damping"]} if "damping" in stated else {}


@dataclass(frozen=True)
class Joint(Rig):
    """One joint with viscous damping, moved by a commanded effort or by nothing.

        inertia_scale M v' = effort - gravity_scale (A cos(q) + B sin(q)) - damping v

    M, A and B are read off Pinocchio's CRBA and gravity of the URDF (`constants`: `inertia`, `gravity_cos`,
    `gravity_sin`, `revolute`); for a prismatic joint (`revolute` 0) gravity is the constant A. The effort is held
    between samples. Each trial has its own initial position and velocity. `idle` is where no effort is needed to rest:
    A cos(q) + B sin(q) = 0; hanging, or standing if that is nearer to where an effort holds the joint; 0 for a
    prismatic joint.

    Dry friction that the URDF states is a constant too, `friction`, and acts as `coulomb_friction` of that torque does.
    That cause is then what there is beyond it, or below 0 what it is too much; its forms are those of both together.

    The bearing of a revolute joint carries the pull along the arm, in units of the URDF's weight at rest W (that of the
    simple pendulum with the same A, B and M; 1 for a prismatic joint, and where the joint feels no gravity):

        bearing_load = (gravity_scale d/dq (A cos(q) + B sin(q)) + inertia_scale M v^2) / W,   W^2 = A^2 + B^2
    """

    inertia_scale: float = parameter(1.0, lower=1e-3, upper=1e3, scale=0.1)
    damping: float = parameter(0.0, unit="{effort} s/{q}", lower=0.0, upper=1e8, scale=1e-3)
    gravity_scale: float = parameter(1.0, lower=-10.0, upper=10.0, scale=0.1)

    name, needed = "joint", ("inertia", "gravity_cos", "gravity_sin", "revolute")
    computed: ClassVar[Mapping[str, NumberKey]] = {"inertia": positive("kg m2 or kg", False)}
    settings = ("--set position0=0.5 --set velocity0=0", "--set kind=imposed")
    rate_of: ClassVar[Mapping[str, str]] = {"velocity": "position"}
    begins = "A column position gives the initial state by its first sample."
    schema = RigSchema(
        constants={},
        files={"urdf": True},
        start={
            "inertia_scale": positive(""),
            "damping": not_negative("N m s/rad or N s/m"),
            "gravity_scale": not_negative("", False),
        },
        start_may_be_known=True,
        conditions={
            "position0": any_number("rad or m", False),
            "velocity0": any_number("rad/s or m/s", False),
            **START_S,
        },
        default_kind="motion",
        outputs={"motion": "position", IMPOSED: "effort"},
        inputs=("effort",),
        inputs_required=False,
        optional=("velocity",),
        imposed=("position", "velocity"),
        check_files=_check_urdf,
        stated=_stated,
    )

    @classmethod
    def of_study(cls, study: Study) -> "Joint":
        if study.urdf is None:
            raise InputError("missing; expected the joint's URDF", file=study.folder, column="urdf")
        driven = any("effort" in t.columns for t in study.trials)
        return joint_model(study.urdf, study.constants, study.start, driven)

    def time_constants(self, kinds: Collection[str]) -> dict[str, float]:
        if set(kinds) == {IMPOSED}:
            return {}
        weight = math.hypot(self.constants["gravity_cos"], self.constants["gravity_sin"])
        stiffness = abs(self.gravity_scale) * weight
        if self.constants["revolute"] and stiffness > 0.0:
            return {"the swing's period over a turn": math.sqrt(self._inertia / stiffness)}
        return {RUN_OUT: self.decay_s()} if self.damping > 0.0 else {}

    @property
    def _inertia(self) -> float:
        return self.inertia_scale * self.constants["inertia"]

    def decay_s(self) -> float:
        return self._inertia / self.damping if self.damping > 0.0 else math.inf

    def check_prediction(self, trial: Trial) -> None:
        if trial.kind == IMPOSED:
            return
        if "position" not in trial.columns and "position0" not in trial.conditions:
            raise trial.error("missing; expected it (its first sample) or position0 among the conditions", "position")

    @classmethod
    def conditions_to_try(cls, study: Study) -> set[tuple[str, tuple[tuple[str, float], ...]]]:
        """Released at rest, from positions that trials began at; none where every motion was imposed."""
        starts = [float(t["position"][0]) for t in study.trials if t.kind != IMPOSED]
        if not starts:
            return set()
        released = np.quantile(starts, (0.0, 0.25, 0.5, 0.75, 1.0))
        return {("motion", (("position0", round(float(p), 4)), ("velocity0", 0.0))) for p in released}

    def units(self) -> Mapping[str, str]:
        return ROTARY if self.constants.get("revolute", 1.0) else SLIDING

    def signals(self, kind: str) -> tuple[str, ...]:
        if kind == IMPOSED:
            return ("gravity_angle", "play", "torque", "friction", "effort", "reading")
        return ("gravity_angle", "effort", "torque", "friction", "driving", "acceleration", "play", "reading")

    def states(self, kind: str) -> tuple[str, ...]:
        return () if kind == IMPOSED else ("q", "v")

    def memories(self, kind: str) -> tuple[str, ...]:
        return () if kind == IMPOSED else ("rest",)

    def unknowns(self, kind: str) -> tuple[str, ...]:
        return () if kind == IMPOSED else ("initial_position", "initial_velocity")

    def outputs(self, kind: str) -> tuple[str, ...]:
        return ("effort",) if kind == IMPOSED else ("position", "velocity")

    def undetermined(self) -> tuple[str, ...]:
        """Return a gain of the effort where every torque but a stated friction is in proportion to a fitted parameter.

        Friction that is stated too small by a factor would look like a gain of that factor, and an inertia, a weight
        and a damping that are wrong by it too.
        """
        weighs = self.constants["gravity_cos"] or self.constants["gravity_sin"]
        scaled = {"inertia_scale", "damping"} | ({"gravity_scale"} if weighs else set())
        return ("effort_gain",) if STATED in self.constants and scaled <= {*self.fitted_parameters()} else ()

    @property
    def predictor_step_s(self) -> float:
        return CoulombFriction.predictor_step_s if STATED in self.constants else math.inf

    def constant_names(self, kind: str) -> tuple[str, ...]:
        return (*self.needed, "idle", *((STATED,) if STATED in self.constants else ()))

    def trial_constants(self, trial: Trial) -> dict[str, float]:
        known = {name: float(self.constants[name]) for name in (*self.needed, STATED) if name in self.constants}
        return {**known, "idle": self._idle(trial)}

    def _idle(self, trial: Trial) -> float:
        """Position at which the joint rests without effort, rad or m: the one nearest to a driven trial's readings."""
        a, b = float(self.constants["gravity_cos"]), float(self.constants["gravity_sin"])
        if not (self.constants["revolute"] and (a or b)):
            return 0.0
        hanging = math.atan2(-a, b)
        if not self.is_driven([trial]):
            return hanging
        read = trial["position"] if "position" in trial.columns else np.empty(0)
        read = read[np.isfinite(read)]
        held = float(np.median(read)) if len(read) else float(trial.conditions.get("position0", hanging))
        return hanging + math.pi * round((held - hanging) / math.pi)

    def initial_unknowns(self, trial: Trial) -> dict[str, float]:
        if trial.kind == IMPOSED:
            return {}
        position, rate = 0.0, 0.0
        if "position" in trial.columns:
            position, rate = float(trial["position"][0]), first_rate(trial.time, trial["position"])
        if "velocity" in trial.columns:
            rate = float(trial["velocity"][0])
        position, rate = trial.conditions.get("position0", position), trial.conditions.get("velocity0", rate)
        return {"initial_position": float(position), "initial_velocity": float(rate)}

    def is_driven(self, trials: Sequence[Trial]) -> bool:
        return any("effort" in t.columns and t.kind != IMPOSED for t in trials)

    def driving_sizes(self, trials: Sequence[Trial]) -> dict[str, float]:
        driven = [t["effort"] for t in trials if "effort" in t.columns]
        c, turns = self.constants, [t["position"] for t in trials if "position" in t.columns]
        along = (c["gravity_cos"] * np.cos(q) + c["gravity_sin"] * np.sin(q) for q in turns if c["revolute"])
        weight = [self.gravity_scale * one for one in along]
        size = math.sqrt(max((float(np.nanmean(x**2)) for many in (driven, weight) for x in many), default=0.0))
        return {"effort": max(size, 1e-9 * self.constants["inertia"])}

    def unmeasured(self, trial: Trial) -> tuple[str, ...]:
        known = trial.kind == IMPOSED or "velocity" in trial.columns or "velocity0" in trial.conditions
        return () if known or "position" not in trial.columns else ("initial_velocity",)

    def read_first(self, trial: Trial) -> Mapping[str, str]:
        known = trial.kind == IMPOSED or "position0" in trial.conditions or "position" not in trial.columns
        return {} if known else {"initial_position": "position"}

    def set_rest(self, s: Signals, z: Any) -> None:
        if s.kind == IMPOSED:
            s.q, s.inertia = s.c.imposed_start, self.inertia_scale * s.c.inertia
            s.sensed = self._gravity(s, 0.0)[0]
            return
        s.x.q, s.x.v, s.m.rest = s.initial.initial_position, s.initial.initial_velocity, s.initial.initial_position
        s.q = s.sensed = s.x.q
        s.sensed_rate = s.x.v

    def sample(self, s: Signals) -> dict[str, Any]:
        s.inertia = self.inertia_scale * s.c.inertia
        if s.kind == IMPOSED:
            s.q = s.sensed = imposed_now(s)[0]
        else:
            s.q = s.sensed = s.x.q
        return {}

    def rates(self, s: Signals) -> dict[str, Any]:
        s.act, s.inertia = 0.0, self.inertia_scale * s.c.inertia
        if s.kind == IMPOSED:
            return self._imposed(s)
        s.q, s.v, s.sensed = s.x.q, s.x.v, s.through("play", s.x.q)
        gravity, s.bearing_load = self._gravity(s, s.v)
        effort = s.through("effort", getattr(s.u, "effort", 0.0))
        s.torque = self._rubbed(s, s.through("torque", effort - gravity - self.damping * s.v))
        s.driving = s.through("driving", s.torque / s.inertia)
        s.acceleration = s.through("acceleration", s.driving)
        return {"q": s.v, "v": s.acceleration}

    def _imposed(self, s: Signals) -> dict[str, Any]:
        """The effort that an imposed motion takes: what the inertia needs beyond what acts on it anyway."""
        s.q, s.v, bend = imposed_now(s)
        s.q = s.through("play", s.q)
        s.stopping = IMPOSED_STOPPING * s.inertia
        gravity, s.bearing_load = self._gravity(s, s.v)
        s.torque = self._rubbed(s, s.through("torque", -gravity - self.damping * s.v))
        s.sensed = undone(s, "effort", s.inertia * bend - s.torque)
        return {}

    def _rubbed(self, s: Signals, torque: Any) -> Any:
        """Return the torque after dry friction: what is stated acts by itself where no cause holds it already."""
        if STATED in self.constants and not any(isinstance(e, CoulombFriction) for e in s.effects):
            stated = FrictionBeyond(torque_nm=0.0)
            torque = stated.apply(torque, s.of(stated))
        return s.through("friction", torque)

    def _gravity(self, s: Signals, v: Any) -> tuple[Any, Any]:
        """Torque of gravity, and the load of the bearing, at the position and a velocity."""
        c = s.c
        tilted = s.through("gravity_angle", c.revolute * s.q)
        gravity = self.gravity_scale * (c.gravity_cos * cos(tilted) + c.gravity_sin * sin(tilted))
        pull = self.gravity_scale * (c.gravity_sin * cos(tilted) - c.gravity_cos * sin(tilted)) + s.inertia * v * v
        weight = sqrt(c.gravity_cos * c.gravity_cos + c.gravity_sin * c.gravity_sin)
        swings = where(weight > WEIGHTLESS * c.inertia, c.revolute, 0.0)
        return gravity, 1.0 + swings * (pull / where(swings > 0.0, weight, 1.0) - 1.0)

    def readings(self, s: Signals) -> tuple[Any, ...]:
        if s.kind == IMPOSED:
            s.rest_reading = s.idle_reading = 0.0
            self.rates(s)
            return (s.through("reading", s.sensed),)
        s.rest_reading, s.idle_reading, s.sensed = s.m.rest, s.c.idle, s.through("play", s.x.q)
        return s.through("reading", s.sensed), s.x.v


def joint_model(urdf: Path, constants: Mapping[str, Any], start: Mapping[str, Any], driven: bool = True) -> Joint:
    """A one-joint rig from its URDF.

    Parameters
    ----------
    constants
        Parameters of the nominal model that are known.
    start
        Those that are fitted, with their start values.
    driven
        False for free motion, without an effort.

    Raises
    ------
    InputError
        If Pinocchio cannot read the URDF.
    """
    body = load_urdf(urdf)
    cosine, sine = gravity_coefficients(body)
    known = {n: constants[n] for n in Joint.parameters() if n in constants}
    read = {"inertia": joint_inertia(body), "gravity_cos": cosine, "gravity_sin": sine}
    read["revolute"] = float(joint_is_revolute(body))
    if (friction := stated_of_joint(urdf).get(STATED, 0.0)) > 0.0:
        read[STATED] = friction
    fitted = tuple(n for n in Joint.parameters() if n in start)
    if not driven and "gravity_scale" in fitted:  # free motion shows only ratios: the URDF's inertia holds
        fitted = tuple(n for n in fitted if n != "inertia_scale")
    return Joint(constants=read, fitted=fitted, **{**known, **start})
