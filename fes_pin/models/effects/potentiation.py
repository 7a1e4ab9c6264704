"""Force capacity rises with recent use and decays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fes_pin.models.parameters import parameter
from fes_pin.models.stage import Effect, Stage


@dataclass(frozen=True)
class Potentiation(Effect):
    """Force capacity rises with recent use and decays.

        decay p'  = act - p
        F         = (1 + gain p) F_M

    Tell-tale: the first answers of a trial are too weak against those that follow soon after them; a pause brings
    the weakness back.
    Source: Rassier and MacIntosh, Braz. J. Med. Biol. Res. 33 (2000): coexistence of potentiation and fatigue.
    """

    gain: float = parameter(0.05, null=0.0, lower=0.0, upper=3.0, scale=0.05)
    decay_s: float = parameter(2.5, unit="s", lower=0.15, upper=60.0, scale=0.5, grid=(2.5, 0.8, 8.0))

    name, stage, signal, rigs = "potentiation", Stage.MUSCLE, "force", ("ankle", "muscle")
    states = ("level",)

    def apply(self, value: Any, s: Any) -> Any:
        return value * (1.0 + self.gain * s.own.level)

    def rate(self, s: Any) -> Mapping[str, Any]:
        return {"level": (s.act - s.own.level) / self.decay_s}
