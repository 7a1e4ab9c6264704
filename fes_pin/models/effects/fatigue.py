"""Force capacity falls with use and recovers with rest."""

from dataclasses import dataclass

from fes_pin.models.session import after_the_past
from fes_pin.models.stage import ByName, Effect, Scalar, Signals, Stage, parameter

FLOOR = 0.35
"""Share of the force that never tires; Riener and Fuhr fit 0.3 to 0.4 to quadriceps."""


@dataclass(frozen=True)
class Fatigue(Effect):
    """Force capacity falls with use and recovers with rest.

        c'  = (1 - c) / recovery - rate act (c - FLOOR)
        F   = c F_M,   c = 1   at the start of the session

    Where trials say when they began, c runs on through them and the pauses between; else it is 1 at the start of each.

    Tell-tale: equal stimuli are answered ever more weakly within a trial, or from trial to trial, in proportion at all
    levels, and rest restores some.
    Source: Riener and Fuhr, IEEE Trans. Rehab. Eng. 6 (1998), with their floor of capacity; recovery times of 20 to
    60 s there.
    """

    rate_per_s: float = parameter(0.02, unit="1/s", null=0.0, lower=0.0, upper=5.0, scale=0.02)
    recovery_s: float = parameter(30.0, unit="s", lower=0.5, upper=300.0, scale=10.0, grid=(30.0, 5.0, 120.0))

    name, stage, signal, rigs = "fatigue", Stage.MUSCLE, "force", ("ankle", "muscle")
    states, remembers = ("lost",), True

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value * (1.0 - s.own.lost)

    def rest(self, s: Signals) -> ByName:
        speed, recovery = self.rate_per_s, 1.0 / self.recovery_s
        lost = after_the_past(
            s, lambda act: speed * act + recovery, lambda act: speed * act * (1.0 - FLOOR) / (speed * act + recovery)
        )
        return {"lost": lost}

    def rate(self, s: Signals) -> ByName:
        lost = s.own.lost
        return {"lost": self.rate_per_s * s.act * (1.0 - FLOOR - lost) - lost / self.recovery_s}
