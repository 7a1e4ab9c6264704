"""Drag in proportion to the square of the speed."""

from dataclasses import dataclass

from fes_pin.models.maths import fabs
from fes_pin.models.stage import Effect, Scalar, Signals, Stage, parameter


@dataclass(frozen=True)
class QuadraticDamping(Effect):
    """Drag in proportion to the square of the speed.

        torque - coefficient v |v|

    Tell-tale: fast swings die faster than slow ones.
    Source: Newton's drag; for a swinging body see Nelson and Olsson, Am. J. Phys. 54 (1986).
    """

    coefficient: float = parameter(0.01, unit="{effort} s2/{q}2", null=0.0, lower=0.0, upper=1e8, scale=0.01)

    name, stage, signal, rigs = "quadratic_damping", Stage.JOINT, "torque", ("ankle", "joint")
    dissipative = True

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value - self.coefficient * s.v * fabs(s.v)
