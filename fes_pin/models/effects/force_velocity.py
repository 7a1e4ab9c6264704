"""Force depends on the shortening velocity, in proportion to activation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fes_pin.models.parameters import parameter
from fes_pin.models.stage import Effect, Stage


@dataclass(frozen=True)
class ForceVelocity(Effect):
    """Force depends on the shortening velocity, in proportion to activation.

        F = F_M (1 - x + bend x^2),   x = slope v,   v > 0 shortens the muscle

    Tell-tale: fast motion under stimulation is damped, the same motion without it is not.
    Source: Hill, Proc. R. Soc. B 126 (1938); his hyperbola (1 - x) / (1 + c x), near rest, with bend about c.
    """

    slope_s_per_rad: float = parameter(0.05, unit="s/rad", null=0.0, lower=-0.5, upper=2.0, scale=0.05)
    bend: float = parameter(0.0, null=0.0, lower=-20.0, upper=20.0, scale=0.5, optional=True, grid=(0.5,))

    name, stage, signal, rigs = "force_velocity", Stage.MUSCLE, "force", ("ankle",)

    def apply(self, value: Any, s: Any) -> Any:
        x = self.slope_s_per_rad * s.v
        return value * (1.0 - x + self.bend * x * x)
