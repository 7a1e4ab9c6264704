"""Activation falls with another time constant than it rises with."""

from dataclasses import dataclass

from fes_pin.models.maths import exp, where
from fes_pin.models.stage import Effect, Scalar, Signals, Stage, parameter


@dataclass(frozen=True)
class RiseFallAsymmetry(Effect):
    """Activation falls with another time constant than it rises with.

        tau -> exp(log_ratio) tau where r < act

    Tell-tale: with one time constant rises come out too slow and falls too fast, or the reverse.
    Source: Zajac, Crit. Rev. Biomed. Eng. 17 (1989): activation and deactivation.
    """

    log_ratio: float = parameter(
        0.2, null=0.0, lower=-2.5, upper=2.5, scale=0.1, words=lambda v: "a longer one" if v > 0.0 else "a shorter one"
    )

    name, stage, signal, rigs = "rise_fall_asymmetry", Stage.MUSCLE, "time_constant", ("ankle", "muscle")

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value * where(s.r < s.act, exp(self.log_ratio), 1.0)
