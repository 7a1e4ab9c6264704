"""Force capacity rises with recent use and decays."""

from dataclasses import dataclass

from fes_pin.models.session import after_the_past
from fes_pin.models.stage import ByName, Effect, Scalar, Signals, Stage, parameter


@dataclass(frozen=True)
class Potentiation(Effect):
    """Force capacity rises with recent use and decays.

        decay p'  = act - p
        F         = (1 + gain p) F_M,   p = 0   at the start of the session

    Where trials say when they began, p runs on through them and the pauses between; else it is 0 at the start of each.

    Tell-tale: the first answers of a trial are too weak against those that follow soon after them; a pause brings
    the weakness back.
    Source: Rassier and MacIntosh, Braz. J. Med. Biol. Res. 33 (2000): coexistence of potentiation and fatigue.
    """

    gain: float = parameter(0.05, null=0.0, lower=0.0, upper=3.0, scale=0.05)
    decay_s: float = parameter(2.5, unit="s", lower=0.15, upper=60.0, scale=0.5, grid=(2.5, 0.8, 8.0))

    name, stage, signal, rigs = "potentiation", Stage.MUSCLE, "force", ("ankle", "muscle")
    states, remembers = ("level",), True

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value * (1.0 + self.gain * s.own.level)

    def rest(self, s: Signals) -> ByName:
        return {"level": after_the_past(s, lambda act: 1.0 / self.decay_s, lambda act: act)}

    def rate(self, s: Signals) -> ByName:
        return {"level": (s.act - s.own.level) / self.decay_s}
