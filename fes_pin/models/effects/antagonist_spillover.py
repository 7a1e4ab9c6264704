"""Above some pulse width the stimulus also recruits the antagonist."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fes_pin.models.maths import clip, maximum
from fes_pin.models.parameters import parameter
from fes_pin.models.stage import Effect, Stage


@dataclass(frozen=True)
class AntagonistSpillover(Effect):
    """Above some pulse width the stimulus also recruits the antagonist.

        r_s     = clip((w - onset) / (saturation - onset), 0, 1)
        tau b'  = r_s - b
        F_net   = F_M - share K F_ref b

    Tell-tale: the strongest stimuli move the joint less than weaker ones promise, though the muscle alone pulls as
    modelled.
    Source: Popovic and Sinkjaer, Control of Movement for the Physically Disabled, Springer 2000: spread of current
    to neighbouring nerves.
    """

    share: float = parameter(0.05, null=0.0, lower=0.0, upper=2.0, scale=0.05)
    onset_us: float = parameter(
        600.0, unit="us", lower=0.0, upper=2000.0, scale=50.0, grid=(300.0, 450.0, 600.0, 750.0, 900.0)
    )

    name, stage, signal, rigs = "antagonist_spillover", Stage.NERVE, "net_force", ("ankle",)
    states = ("act",)
    memories = ("recruited",)

    def apply(self, value: Any, s: Any) -> Any:
        return value - self.share * s.force_scale * s.own.act

    def rate(self, s: Any) -> Mapping[str, Any]:
        return {"act": (s.own.recruited - s.own.act) / s.time_constant}

    def update(self, s: Any) -> Mapping[str, Any]:
        room = maximum(s.c.saturation_us - self.onset_us, 1.0)
        return {"recruited": clip((s.u.pulse_width_us - self.onset_us) / room, 0.0, 1.0)}
