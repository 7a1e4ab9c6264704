"""An extra passive spring."""

from dataclasses import dataclass

import numpy as np

from fes_pin.models.maths import exp, ramp, sqrt
from fes_pin.models.stage import Bounds, Effect, Grids, Measured, Scalar, Signals, Stage, parameter, refinement

FLAT = 1e-6
"""Squared rate at which the exponential is a straight line, 1/m2."""


@dataclass(frozen=True)
class ParallelStiffness(Effect):
    """An extra passive spring.

        torque - stiffness x (1 + hardening x^2)                      on ankle or joint
        force + stiffness x,   x > 0                                  on muscle, without hardening_per_rad2
        force + stiffness (exp(a x) - 1) / a,   x > 0                 on muscle, with hardening_per_rad2
        a = sqrt(6 hardening)                                         on muscle, with hardening_per_rad2
        x = q - rest_angle

    It pulls back: what pushes a joint away from an angle is gravity, or a muscle.

    Tell-tale: the joint is held too softly, at all speeds and activations alike, around some angle of its own.
    Source: Zajac, Crit. Rev. Biomed. Eng. 17 (1989), for passive muscle, which only pulls; for joints Winters,
    in Multiple Muscle Systems, Springer 1990: passive joint elasticity; it stiffens with the angle.
    """

    stiffness_nm_per_rad: float = parameter(0.05, unit="{effort}/{q}", null=0.0, lower=0.0, upper=1e8, scale=0.05)
    rest_angle_rad: float = parameter(1.6, unit="{q}", scale=0.1, times="stiffness_nm_per_rad")
    hardening_per_rad2: float = refinement(
        0.0, unit="1/{q}2", lower=0.0, upper=1e7, scale=1.0, grid=(1.0,), words="which hardens"
    )

    name, stage, signal, rigs = "parallel_stiffness", Stage.JOINT, "torque", ("ankle", "joint", "muscle")

    @classmethod
    def grids(cls, measured: Measured) -> Grids:
        """A spring at rest in the middle of the measured motion, or at an end of it."""
        angles = next((measured[n] for n in ("angle_rad", "position", "length_m") if n in measured), None)
        if angles is None:
            return super().grids(measured)
        places = tuple(float(np.quantile(angles, q)) for q in (0.5, 0.0, 1.0))
        return {**super().grids(measured), "rest_angle_rad": places}

    def limits(self, measured: Measured) -> Bounds:
        """The spring rests no farther off than the joint moves; elsewhere it would be a constant torque."""
        angles = next((measured[n] for n in ("angle_rad", "position", "length_m") if n in measured), None)
        if angles is None:
            return {}
        low, high = float(np.min(angles)), float(np.max(angles))
        return {"rest_angle_rad": (2.0 * low - high, 2.0 * high - low)}

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        x = s.q - self.rest_angle_rad
        if hasattr(s, "isometric"):
            rate = sqrt(6.0 * self.hardening_per_rad2 + FLAT)
            return value - self.stiffness_nm_per_rad * (exp(rate * ramp(x)) - 1.0) / rate
        return value - self.stiffness_nm_per_rad * x * (1.0 + self.hardening_per_rad2 * x * x)
