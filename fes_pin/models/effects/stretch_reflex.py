"""A torque against fast motion in one direction, some tens of milliseconds late."""

from dataclasses import dataclass

from fes_pin.models.maths import ramp
from fes_pin.models.stage import ByName, Effect, Scalar, Signals, Stage, parameter


@dataclass(frozen=True)
class StretchReflex(Effect):
    """A torque against fast motion in one direction, some tens of milliseconds late.

        torque - side gain ramp(side u),   u = v(t - delay) = v - delay w'
        w''  = 12 (v - w) / delay^2 - 6 w' / delay

    Tell-tale: fast motion in one direction is braked, but late, so that it rings.
    Source: Matthews, Trends Neurosci. 14 (1991): short-latency reflex. The delay is Pade's of order (2, 2), good to
    1 degree of phase below 1 / (2 delay) Hz.
    """

    gain_nms: float = parameter(0.01, unit="N m s", null=0.0, lower=0.0, upper=10.0, scale=0.005)
    delay_s: float = parameter(0.045, unit="s", lower=0.01, upper=0.2, scale=0.01, grid=(0.045, 0.025, 0.08))
    side: float = parameter(1.0, grid=(1.0, -1.0), fitted=False)

    name, stage, signal, rigs = "stretch_reflex", Stage.JOINT, "torque", ("ankle",)
    states = ("follow", "change")

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        late = s.v - self.delay_s * s.own.change
        return value - self.side * self.gain_nms * ramp(self.side * late)

    def rate(self, s: Signals) -> ByName:
        own, pace = s.own, 1.0 / self.delay_s
        return {"follow": own.change, "change": 12.0 * pace * pace * (s.v - own.follow) - 6.0 * pace * own.change}
