"""A pure delay from pulse to force."""

from dataclasses import dataclass

from fes_pin.models.stage import Effect, Scalar, Signals, Stage, parameter


@dataclass(frozen=True)
class ElectromechanicalDelay(Effect):
    """A pure delay from pulse to force.

        r(t) -> r(t - delay)

    Tell-tale: every answer to the stimulus comes late by the same time, rises and falls alike.
    Source: Cavanagh and Komi, Eur. J. Appl. Physiol. 42 (1979): 10 to 50 ms.
    """

    delay_s: float = parameter(0.01, unit="s", null=0.0, lower=0.0, upper=0.3, scale=0.005, grid=(0.01, 0.02, 0.05))

    name, stage, signal, rigs = "electromechanical_delay", Stage.MUSCLE, "delay", ("ankle", "muscle")

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value + self.delay_s
