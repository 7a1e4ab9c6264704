"""Force of a train of pulses is not the sum of its twitches."""

from dataclasses import dataclass

from fes_pin.models.maths import power
from fes_pin.models.stage import Effect, Scalar, Signals, Stage, parameter, refinement

LEAST = 1e-3
"""Activation below which its powers are replaced by a straight line, which keeps derivatives finite."""


@dataclass(frozen=True)
class PulseSummation(Effect):
    """Force of a train of pulses is not the sum of its twitches.

        act -> (1 + saturation) c / (1 + saturation c),   c = act^(1 + cooperation)

    The activation is the calcium that the pulses release; of it the binding sites take a share that saturates.

    Tell-tale: a second pulse adds more than the first made, or less; at high rates force grows no more, and falls late.
    Source: Ding, Wexler and Binder-Macleod, J. Appl. Physiol. 88 (2000): C / (K + C); Hatze, Biol. Cybern. 25 (1977),
    and Curtin, Gardner-Medwin and Woledge, J. Exp. Biol. 201 (1998): a power of the calcium that saturates.
    """

    saturation: float = parameter(1.0, null=0.0, lower=-0.9, upper=200.0, scale=0.5)
    cooperation: float = refinement(0.0, lower=-0.5, upper=4.0, scale=0.5, grid=(1.0,), words="as a power of their sum")

    name, stage, signal, rigs = "pulse_summation", Stage.MUSCLE, "summation", ("muscle",)

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        bound = value * power(value, self.cooperation, LEAST)
        return (1.0 + self.saturation) * bound / (1.0 + self.saturation * bound)
