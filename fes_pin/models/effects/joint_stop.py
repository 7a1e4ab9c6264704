"""A stiff limit that the motion reaches."""

from dataclasses import dataclass

import numpy as np

from fes_pin.models.maths import ramp
from fes_pin.models.stage import Bounds, Effect, Grids, Measured, Scalar, Signals, Stage, parameter


@dataclass(frozen=True)
class JointStop(Effect):
    """A stiff limit that the motion reaches.

        torque - side stiffness ramp(side (q - angle))

    Tell-tale: the motion turns back at one angle more sharply than modelled, and only there.
    Source: Dombre, Fournier and Coiffet, section I, which names it among what must be identified.
    """

    stiffness: float = parameter(0.1, unit="{effort}/{q}", null=0.0, lower=0.0, upper=1e8, scale=0.1)
    angle_rad: float = parameter(1.9, unit="{q}", scale=0.05)
    side: float = parameter(1.0, grid=(1.0, -1.0), fitted=False)

    name, stage, signal, rigs = "joint_stop", Stage.JOINT, "torque", ("ankle", "joint")

    @classmethod
    def grids(cls, measured: Measured) -> Grids:
        """Angles at the ends of the measured range, where a stop can be."""
        angles = measured.get("angle_rad", measured.get("position"))
        if angles is None:
            return super().grids(measured)
        quantiles = np.quantile(angles, (0.98, 0.93, 0.85, 0.7, 0.5, 0.3, 0.15, 0.07, 0.02))
        return {**super().grids(measured), "angle_rad": tuple(float(a) for a in quantiles)}

    def limits(self, measured: Measured) -> Bounds:
        """A stop is inside the measured range, and out of touch for a third of the time; else it would be a spring."""
        angles = measured.get("angle_rad", measured.get("position"))
        if angles is None:
            return {}
        low, high = (0.35, 0.999) if self.side > 0 else (0.001, 0.65)
        return {"angle_rad": (float(np.quantile(angles, low)), float(np.quantile(angles, high)))}

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value - self.side * self.stiffness * ramp(self.side * (s.q - self.angle_rad))
