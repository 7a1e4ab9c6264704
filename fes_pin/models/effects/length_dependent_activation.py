"""The same stimulus activates a longer muscle more."""

from dataclasses import dataclass

from fes_pin.models.maths import exp, power
from fes_pin.models.stage import Bounds, Effect, Measured, Scalar, Signals, Stage, parameter, span

LEAST = 1e-3
"""Activation below which its power is replaced by a straight line, which keeps derivatives finite."""


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

    def limits(self, measured: Measured) -> Bounds:
        """Over the imposed lengths the power changes by no more than a factor of twenty."""
        way = span(measured, "length_m")
        return {"slope": (-3.0 / way, 3.0 / way)} if way > 0.0 else {}

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        exponent = exp(-self.slope * getattr(s, "bent", 0.0))
        return value * power(value, exponent - 1.0, LEAST)
