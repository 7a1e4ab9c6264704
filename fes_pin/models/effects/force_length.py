"""Force depends on the joint angle through the muscle's length."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fes_pin.models.maths import exp
from fes_pin.models.parameters import parameter
from fes_pin.models.stage import Effect, Stage

UPRIGHT = 1.5707963267948966
"""The angle of the largest lever, pi/2 rad, where the factor is 1."""


@dataclass(frozen=True)
class ForceLength(Effect):
    """Force depends on the joint angle through the muscle's length.

        F = F_M exp(slope (theta - pi/2) - curvature (theta - pi/2)^2)

    Tell-tale: the force is right at one angle and wrong at others, in proportion to activation.
    Source: Zajac, Crit. Rev. Biomed. Eng. 17 (1989): the bell of the active force; a Gaussian centred anywhere.
    """

    slope_per_rad: float = parameter(0.2, unit="1/rad", null=0.0, lower=-10.0, upper=10.0, scale=0.1)
    curvature_per_rad2: float = parameter(0.2, unit="1/rad2", null=0.0, lower=-10.0, upper=30.0, scale=0.2)

    name, stage, signal, rigs = "force_length", Stage.MUSCLE, "force", ("ankle",)

    def apply(self, value: Any, s: Any) -> Any:
        bent = s.q - UPRIGHT
        return value * exp((self.slope_per_rad - self.curvature_per_rad2 * bent) * bent)
