"""A spring and damper in series across the joint: passive torque depends on history."""

from dataclasses import dataclass

import numpy as np

from fes_pin.models.stage import Bounds, ByName, Effect, Measured, Scalar, Signals, Stage, parameter

NOTHING = 1e-30
"""Below any square of a motion: a rig that begins at rest has 0 / 0."""


@dataclass(frozen=True)
class PassiveRelaxation(Effect):
    """A spring and damper in series across the joint: passive torque depends on history.

        relaxation y' = q - y
        torque - stiffness (q - y)

    Tell-tale: after a fast change of angle the joint creeps on for a while; slow motion is as modelled.
    Source: Maxwell's element; for muscle Proske and Morgan, J. Biomech. 32 (1999), thixotropy and passive tension.
    """

    stiffness_nm_per_rad: float = parameter(0.05, unit="{effort}/{q}", null=0.0, lower=0.0, upper=1e8, scale=0.05)
    relaxation_s: float = parameter(0.3, unit="s", lower=0.02, upper=30.0, scale=0.1, grid=(0.3, 0.08, 1.2, 5.0))

    name, stage, signal, rigs = "passive_relaxation", Stage.JOINT, "torque", ("ankle", "joint")
    states = ("relaxed",)
    dissipative = True

    def limits(self, measured: Measured) -> Bounds:
        """It relaxes within the longest trial; what relaxes more slowly is a spring there."""
        longest = float(np.max(measured.get("time", np.zeros(1))))
        return {"relaxation_s": (0.0, longest)} if longest > 0.0 else {}

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value - self.stiffness_nm_per_rad * (s.q - s.own.relaxed)

    def rate(self, s: Signals) -> ByName:
        return {"relaxed": (s.q - s.own.relaxed) / self.relaxation_s}

    def rest(self, s: Signals) -> ByName:
        return {"relaxed": s.q}

    def start_variances(self, reach: Scalar, speed: Scalar) -> ByName:
        """Return the variance of the damper's initial state, which is unknown in trials that begin in motion."""
        late = self.relaxation_s * speed
        return {"relaxed": late * late * reach * reach / (late * late + reach * reach + NOTHING)}
