"""The load's recorded mass is off by a factor."""

from dataclasses import dataclass

from fes_pin.models.stage import Effect, Scalar, Signals, Stage, parameter


@dataclass(frozen=True)
class LoadError(Effect):
    """The load's recorded mass is off by a factor.

        M -> (1 + error) M

    Tell-tale: rest angles are off, the more the heavier the load.
    Source: a balance or a list of weights that is off by a factor.
    """

    error: float = parameter(
        0.01,
        null=0.0,
        lower=-0.9,
        upper=5.0,
        scale=0.01,
        words=lambda v: "too low" if v > 0.0 else "too high",
    )

    name, stage, signal, rigs = "load_error", Stage.RIG, "load", ("ankle",)

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value * (1.0 + self.error)
