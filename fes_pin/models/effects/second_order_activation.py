"""A second lag in series with the activation."""

from dataclasses import dataclass

from fes_pin.models.maths import lag
from fes_pin.models.stage import ByName, Effect, Scalar, Signals, Stage, parameter


@dataclass(frozen=True)
class SecondOrderActivation(Effect):
    """A second lag in series with the activation.

        second a2' = act - a2,   a2 replaces act

    Tell-tale: the first moments after a step of the stimulus are answered too softly: the force starts with no
    slope.
    Source: Baratta and Solomonow, IEEE Trans. Biomed. Eng. 37 (1990): muscle as a second-order low pass.
    """

    second_s: float = parameter(0.005, unit="s", null=0.0, lower=0.0, upper=0.5, scale=0.005)

    name, stage, signal, rigs = "second_order_activation", Stage.MUSCLE, "activation", ("ankle", "muscle")
    states = ("lagged",)
    max_step_s = 1.25e-3

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        s.unlagged = value
        return lag(value, s.own.lagged, self.second_s, s.step)[0]

    def rest(self, s: Signals) -> ByName:
        return {"lagged": s.x.act}

    def rate(self, s: Signals) -> ByName:
        return {"lagged": lag(s.unlagged, s.own.lagged, self.second_s, s.step)[1]}
