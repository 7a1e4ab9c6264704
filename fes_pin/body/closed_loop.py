"""Whether a set of inputs catches a fall in the body's full equations of motion, planned again at every pulse.

The controller knows the state and the linear model: at every pulse it solves the plan whose modes stray least
(`fes_pin.body.plans`) and gives its first input. The body that it acts on is Pinocchio's: finite angles and velocities.
Torques follow the stimulation at once, the state is known without error, and moment arms are those of the posture, as
the linear model has them; with `moving_arms` they follow the joints, a stiffness of its own that the plan does not
know. What is held here may still be lost with a person.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pinocchio as pin

from fes_pin.body.balance import model_of, soles_of
from fes_pin.body.catchable import plans_of
from fes_pin.body.ground import centre_of_pressure
from fes_pin.body.inputs import Inputs
from fes_pin.body.joints import JOINT_NAMES, angles_array
from fes_pin.body.linear_body import LinearBody
from fes_pin.body.plans import PULSE_S, SETTLE_DEG
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import positive_number, truth
from fes_pin.data.show import Tabulated

STEP_S = 0.002
"""Step of the Runge-Kutta integration, s; the fastest falls here double in ten of them."""
LOST_DEG = 45.0
"""A joint this far from the posture is lost: no linear model reaches there (`fes_pin.body.catchable.lean_text`)."""


@dataclass(frozen=True, eq=False)
class Caught(Tabulated):
    """A run of the closed loop.

    Parameters
    ----------
    joint_names
        The joints that move.
    time_s, deviation
        At each pulse: (T,) s, and the joints' deviations from the posture: (T, n) rad.
    stimulation
        Inputs given from each pulse on: (T - 1, m).
    outside_m
        How far the centre of pressure went outside the soles, m; negative inside.
    lost
        Why the body fell, or nothing.
    """

    joint_names: tuple[str, ...]
    time_s: np.ndarray = field(repr=False)
    deviation: np.ndarray = field(repr=False)
    stimulation: np.ndarray = field(repr=False)
    outside_m: float
    lost: str = ""

    _index = "time_s"

    @property
    def last_deg(self) -> float:
        """Largest deviation in the last fifth of the run, degrees."""
        return float(np.degrees(np.abs(self.deviation[-max(1, len(self.deviation) // 5) :]).max()))

    def _table(self) -> dict[str, Any]:
        return {"time_s": self.time_s.tolist(), **dict(zip(self.joint_names, self.deviation.T.tolist(), strict=True))}

    def __str__(self) -> str:
        if self.lost:
            return f"lost after {self.time_s[-1]:.2f} s: {self.lost}"
        return f"held for {self.time_s[-1]:.1f} s, within {self.last_deg:.1f} deg of the posture in the end"


def close_the_loop(
    linear: LinearBody,
    inputs,
    start: Mapping[str, float] | np.ndarray,
    seconds: float = 2.0,
    settle_deg: float = SETTLE_DEG,
    balance: bool = True,
    moving_arms: bool = False,
) -> Caught:
    """Release a body at rest off its posture and stimulate it in closed loop, on the full equations of motion.

    Parameters
    ----------
    linear
        From `linearize`, on one foot, with or without braces; what the controller knows.
    inputs
        `Inputs`, `Nerves`, or names of joints.
    start
        Deviations of the joints that move, rad: by name, or (n,).
    seconds
        How long.
    settle_deg, balance
        As `fes_pin.body.catchable.catchable` takes them.
    moving_arms
        Whether nerves have the moment arms of the posture of each moment; the controller knows them at each pulse.

    Raises
    ------
    InputError
        Inputs that are none, a body on both feet, another time than a positive one.
    """
    given = Inputs.of(inputs, linear)
    if linear.both_feet:
        raise InputError("the closed loop is simulated on one foot only")
    start = np.asarray(angles_array(start, linear.joint_names))
    plans = plans_of(linear, given, settle_deg, balance)
    plant, project = _Plant(linear), plans.modes.shapes.T @ linear.A
    q, v = plant.rest + start, np.zeros(linear.n)
    deviations, outside, lost = [start], -np.inf, ""
    given_inputs: list[np.ndarray] = []
    for _ in range(round(positive_number(seconds, "seconds") / PULSE_S)):
        now = plans
        if truth(moving_arms, "moving_arms"):
            try:
                now = replace(plans, inputs=_acting(inputs, linear, q))
            except InputError as error:
                if not given_inputs:  # what was asked is at fault, not where the body went
                    raise
                lost = error.message
                break
        gentlest = now.gentlest(project @ (q - plant.rest), project @ v).solve().x
        if gentlest is None:
            lost = "no input within the bounds brings it back"
            break
        stimulation = gentlest[: given.n]
        torque = now.inputs.on(linear) @ stimulation
        q, v, far = plant.run(q, v, torque)
        outside = max(outside, far)
        deviations.append(q - plant.rest)
        given_inputs.append(stimulation)
        if not np.abs(deviations[-1]).max() < np.radians(LOST_DEG):
            lost = f"{linear.joint_names[int(np.abs(deviations[-1]).argmax())]} is {LOST_DEG:g} degrees off"
            break
    time = PULSE_S * np.arange(len(deviations))
    used = np.array(given_inputs).reshape(len(given_inputs), given.n)
    return Caught(linear.joint_names, time, np.array(deviations), used, outside, lost)


def _acting(inputs, linear: LinearBody, q: np.ndarray) -> Inputs:
    """The inputs with the moment arms of the posture of the moment."""
    if not hasattr(inputs, "torque_matrix"):
        raise InputError("only nerves have moment arms that move", column="moving_arms")
    now = {**dict.fromkeys(JOINT_NAMES, 0.0), **linear.held, **dict(zip(linear.joint_names, q.tolist(), strict=True))}
    return Inputs.pulling(inputs.names, inputs.torque_matrix(now))


class _Plant:
    """The body with its braced joints locked, on the full equations of motion."""

    def __init__(self, linear: LinearBody) -> None:
        whole, q = model_of(linear)
        locked = [whole.getJointId(name) for name in linear.held]
        self.model = pin.buildReducedModel(whole, locked, q) if locked else whole
        self.data = self.model.createData()
        self.extra = -linear.C - pin.computeGeneralizedGravity(self.model, self.data, linear.q)
        self.stiffness = -linear.B - pin.computeGeneralizedGravityDerivatives(self.model, self.data, linear.q)
        self.rest, self.support = np.asarray(linear.q), soles_of(linear)
        self.damping = linear.E

    def _acceleration(self, q: np.ndarray, v: np.ndarray, torque: np.ndarray) -> np.ndarray:
        passive = -self.extra - self.stiffness @ (q - self.rest) - self.damping @ v
        return pin.aba(self.model, self.data, q, v, torque + passive)

    def run(self, q: np.ndarray, v: np.ndarray, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """State after a pulse of constant torque, and how far outside the soles the centre of pressure came, m."""
        far = -np.inf
        for _ in range(round(PULSE_S / STEP_S)):
            far = max(far, self._outside(q, v, self._acceleration(q, v, torque)))
            q, v = self._step(q, v, torque)
        return q, v, far

    def _step(self, q: np.ndarray, v: np.ndarray, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        h = STEP_S
        a1 = self._acceleration(q, v, torque).copy()
        a2 = self._acceleration(q + 0.5 * h * v, v + 0.5 * h * a1, torque).copy()
        a3 = self._acceleration(q + 0.5 * h * v + 0.25 * h**2 * a1, v + 0.5 * h * a2, torque).copy()
        a4 = self._acceleration(q + h * v + 0.5 * h**2 * a2, v + h * a3, torque).copy()
        return q + h * v + h**2 / 6.0 * (a1 + a2 + a3), v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)

    def _outside(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> float:
        rate = pin.computeCentroidalMomentumTimeVariation(self.model, self.data, q, v, a)
        g, foot = self.model.gravity.linear, self.model.inertias[0]
        force = rate.linear - pin.computeTotalMass(self.model) * g
        moment = rate.angular + np.cross(self.data.com[0], force) - np.cross(foot.lever, foot.mass * g)
        return self.support.outside(centre_of_pressure(np.concatenate([force - foot.mass * g, moment])))
