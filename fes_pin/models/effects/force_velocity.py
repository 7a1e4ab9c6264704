"""Force depends on the shortening velocity, in proportion to activation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fes_pin.models.maths import exp
from fes_pin.models.parameters import parameter
from fes_pin.models.stage import Effect, Stage


@dataclass(frozen=True)
class ForceVelocity(Effect):
    """Force depends on the shortening velocity, in proportion to activation.

        F = F_M exp(-slope v),   v > 0 shortens the muscle

    Tell-tale: fast motion under stimulation is damped, the same motion without it is not.
    Source: Hill, Proc. R. Soc. B 126 (1938); the exponential has Hill's slope at rest and stays positive.
    """

    slope_s_per_rad: float = parameter(0.05, unit="s/rad", null=0.0, lower=-0.5, upper=2.0, scale=0.05)

    name, stage, signal, rigs = "force_velocity", Stage.MUSCLE, "force", ("ankle",)

    def apply(self, value: Any, s: Any) -> Any:
        return value * exp(-self.slope_s_per_rad * s.v)
