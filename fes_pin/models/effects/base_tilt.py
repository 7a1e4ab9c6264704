"""Gravity acts at another angle than believed."""

from dataclasses import dataclass

from fes_pin.models.stage import Effect, Scalar, Signals, Stage, parameter


@dataclass(frozen=True)
class BaseTilt(Effect):
    """Gravity acts at another angle than believed.

        g(q) -> g(q + tilt)

    Tell-tale: rest angles are off in a way that depends on the angle; motion about them is nearly right.
    Source: a rotation of the URDF's base about the joint's axis; for a prismatic joint, which reads g(0 + tilt), one
    that raises its axis.
    """

    tilt_rad: float = parameter(0.05, unit="rad", null=0.0, lower=-1.0, upper=1.0, scale=0.02)

    name, stage, signal, rigs = "base_tilt", Stage.RIG, "gravity_angle", ("ankle", "joint")

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value + self.tilt_rad
