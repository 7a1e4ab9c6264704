"""After a stretch the steady force stays above the isometric one at that length."""

from dataclasses import dataclass

from fes_pin.models.maths import ramp
from fes_pin.models.stage import Bounds, ByName, Effect, Measured, Scalar, Signals, Stage, parameter, span

LOST_S = 0.1
"""Time constant with which it is lost where the muscle is not activated, s: it does not outlast deactivation
(Herzog and Leonard, J. Exp. Biol. 205 (2002))."""


@dataclass(frozen=True)
class ResidualForceEnhancement(Effect):
    """After a stretch the steady force stays above the isometric one at that length.

        e' = act stretching speed - (1 - act) e / 0.1 s,   F = F_M (1 + gain e),   e(0) = 0

    Tell-tale: long after an active stretch, or a shortening where the gain is negative, the force at one length differs
    from what it is without; a passive stretch leaves nothing.
    Source: Abbott and Aubert, J. Physiol. 117 (1952); Edman, Elzinga and Noble, J. Gen. Physiol. 80 (1982).
    """

    gain: float = parameter(10.0, unit="1/{q}", null=0.0, lower=-1e4, upper=1e4, scale=10.0)

    name, stage, signal, rigs = "residual_force_enhancement", Stage.MUSCLE, "fibres", ("muscle",)
    states = ("stretched",)

    def limits(self, measured: Measured) -> Bounds:
        """A stretch over the whole way doubles the force at most: no experiment came near."""
        way = span(measured, "length_m")
        return {"gain": (-1.0 / way, 1.0 / way)} if way > 0.0 else {}

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value * (1.0 + self.gain * s.own.stretched)

    def rate(self, s: Signals) -> ByName:
        gained = s.act * ramp(getattr(s, "stretching", 0.0))
        return {"stretched": gained - ramp(1.0 - s.act) * s.own.stretched / LOST_S}
