"""The frame that holds the joint swings as a lightly damped mode driven by the joint's reaction."""

from dataclasses import dataclass

from fes_pin.models.maths import TURN
from fes_pin.models.stage import ByName, Effect, Scalar, Signals, Stage, parameter


@dataclass(frozen=True)
class FrameVibration(Effect):
    """The frame that holds the joint swings as a lightly damped mode driven by the joint's reaction.

        phi'' = -omega^2 phi - 2 zeta omega phi' - coupling torque / J
        q''   = torque / J - phi''
        omega = 2 pi frequency,   zeta = damping_ratio

    Tell-tale: after each sudden change the angle rings at one frequency of its own, whatever the load.
    A mode damped more than any joined frame, which is a fifth of critical at most, does not ring: it was mistaken for
    efforts that a log writes down late.
    Source: Dombre, Fournier and Coiffet, section II-3-2: mechanical vibrations of the metallic frame. coupling = J
    / J_frame. Damping: Newmark and Hall, Earthquake Spectra and Design, EERI 1982, up to 0.2, of nailed wood near
    yield.
    """

    coupling: float = parameter(0.1, null=0.0, lower=0.0, upper=5.0, scale=0.05)
    frequency_hz: float = parameter(
        10.0, unit="Hz", lower=2.0, upper=60.0, scale=1.0, grid=(3.0, 4.5, 6.5, 9.0, 11.0, 13.5, 17.0, 22.0, 30.0)
    )
    damping_ratio: float = parameter(0.05, lower=0.0, upper=0.2, scale=0.02)

    name, stage, signal, rigs = "frame_vibration", Stage.RIG, "acceleration", ("ankle", "joint")
    states = ("angle", "rate")

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value - self._swing(s, value)

    def rate(self, s: Signals) -> ByName:
        # the joint's own acceleration is torque / J = q'' + phi'', solved for it
        return {"angle": s.own.rate, "rate": self._swing(s, s.driving)}

    def start_variances(self, reach: Scalar, speed: Scalar) -> ByName:
        """Return the variance of the frame's initial motion, in trials that begin in motion."""
        swings = (self.coupling * speed) ** 2
        return {"angle": swings / (TURN * self.frequency_hz) ** 2, "rate": swings}

    def _swing(self, s: Signals, driving: Scalar) -> Scalar:
        omega = TURN * self.frequency_hz
        spring = omega * omega * s.own.angle + 2.0 * self.damping_ratio * omega * s.own.rate
        return -spring - self.coupling * driving
