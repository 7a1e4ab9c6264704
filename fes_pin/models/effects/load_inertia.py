"""The load's own inertia, felt through its cable."""

from dataclasses import dataclass

from fes_pin.models.maths import cos, sin
from fes_pin.models.stage import Effect, Scalar, Signals, Stage, parameter, refinement


@dataclass(frozen=True)
class LoadInertia(Effect):
    """The load's own inertia, felt through its cable.

        J + share M l^2 (sin(theta)^2 + wheel cos(theta)^2)

    Tell-tale: heavier loads make the joint slower, not only displaced.
    Source: d'Alembert's principle for a load on a cable at lever l sin(theta), without its slack; share 1 is a
    rigid cable at wheel 0. At wheel 1 the lever is the same at all angles, as of a cable that runs on a wheel.
    """

    share: float = parameter(0.5, null=0.0, lower=0.0, upper=3.0, scale=0.1)
    wheel: float = refinement(
        0.0, lower=0.0, upper=1.0, scale=1.0, fitted=False, grid=(1.0,), words="which runs on a wheel"
    )

    name, stage, signal, rigs = "load_inertia", Stage.JOINT, "driving", ("ankle",)

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        moved = self.share * s.load * s.lever * s.lever
        sine, cosine = sin(s.q), cos(s.q)
        torque = value * s.inertia - moved * (1.0 - self.wheel) * sine * cosine * s.v * s.v
        return torque / (s.inertia + moved * (sine * sine + self.wheel * cosine * cosine))
