"""Dry friction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fes_pin.models.maths import exp, tanh
from fes_pin.models.parameters import parameter
from fes_pin.models.stage import Effect, Stage

V_SMOOTH = 0.002
"""Speed below which dry friction fades, rad/s; far below the speeds of a limb's motion (1 rad/s)."""

STIFFEST = 2.5
"""Largest rate of decay times step that it may show; RK4 is stable to 2.78: Hairer, Wanner, Solving ODEs II, IV.2."""


@dataclass(frozen=True)
class CoulombFriction(Effect):
    """Dry friction at the joint, with or without more of it at rest (Stribeck).

        torque - T (1 + stiction exp(-(v / stribeck_speed)^2)) tanh(v / (V_SMOOTH + T h / (STIFFEST J)))

    h is the integration step: a joint that sticks creeps, as slowly as the step allows.

    Tell-tale: the joint comes to rest at other angles from above than from below; free swings shrink by equal steps.
    Source: Olsson, Astrom, Canudas de Wit, Gafvert and Lischinsky, Friction models and friction compensation,
    European Journal of Control 4 (1998).
    """

    torque_nm: float = parameter(0.01, unit="N m", null=0.0, lower=0.0, upper=100.0, scale=0.01)
    stiction: float = parameter(0.0, null=0.0, lower=-1.0, upper=10.0, scale=0.1, optional=True, grid=(0.3, 1.0))
    stribeck_speed: float = parameter(
        1.0, unit="rad/s", lower=1e-2, upper=30.0, scale=0.5, optional=True, grid=(1.0, 0.2, 4.0)
    )

    name, stage, signal, rigs = "coulomb_friction", Stage.JOINT, "torque", ("ankle", "joint")
    dissipative = True
    max_step_s = 6.25e-4

    def apply(self, value: Any, s: Any) -> Any:
        creep = V_SMOOTH + self.torque_nm * s.step / (STIFFEST * s.inertia)
        ratio = s.v / self.stribeck_speed
        return value - self.torque_nm * (1.0 + self.stiction * exp(-ratio * ratio)) * tanh(s.v / creep)
