"""The same stimulus activates a longer muscle more."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fes_pin.models.maths import exp, log
from fes_pin.models.parameters import parameter
from fes_pin.models.stage import Effect, Stage

LEAST = 1e-3
"""Activation below which a power of it is not told from a straight line: it keeps derivatives finite."""


@dataclass(frozen=True)
class LengthDependentActivation(Effect):
    """The same stimulus activates a longer muscle more.

        act -> act^p,   p = exp(-slope (length - reference))

    Of no activation and of a full one nothing changes at any length: that is `force_length`.

    Tell-tale: force rises sooner and stays longer at long lengths, beyond what the fused contraction differs by.
    Source: Stephenson and Wendt, J. Muscle Res. Cell Motil. 5 (1984): calcium sensitivity rises with length; Hatze,
    Biol. Cybern. 25 (1977), whose rho(length) multiplies the calcium.
    """

    slope: float = parameter(10.0, unit="1/{q}", null=0.0, lower=-1e4, upper=1e4, scale=10.0)

    name, stage, signal, rigs = "length_dependent_activation", Stage.MUSCLE, "sensitivity", ("muscle",)

    def limits(self, measured: Mapping[str, np.ndarray]) -> dict[str, tuple[float, float]]:
        """Over the imposed lengths the power changes by no more than a factor of twenty."""
        way = float(np.ptp(measured["length_m"])) if "length_m" in measured else 0.0
        return {"slope": (-3.0 / way, 3.0 / way)} if way > 0.0 else {}

    def apply(self, value: Any, s: Any) -> Any:
        power = exp(-self.slope * getattr(s, "bent", 0.0))
        return value * exp(0.5 * (power - 1.0) * log(value * value + LEAST * LEAST))
