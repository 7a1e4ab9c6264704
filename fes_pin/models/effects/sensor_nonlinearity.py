"""Curvature of the sensor's characteristic."""

from dataclasses import dataclass

import numpy as np

from fes_pin.models.maths import TURN
from fes_pin.models.stage import FromAPlace, Measured, Scalar, Signals, Stage, counted_from, parameter, refinement


@dataclass(frozen=True)
class SensorNonlinearity(FromAPlace):
    """Curvature of the sensor's characteristic.

        y + curvature x^2 (1 + skew x),   x = y - y_rest

    On a joint y_rest is where a trial begins (`place` 0), where no effort need hold the joint (1), or the zero of its
    URDF (2), whichever fits. The characteristic of an angle repeats itself each turn: none is found where the reading
    passes more than 2 pi, nor where a slide's passes more than 2 pi m.

    Tell-tale: large excursions are read wrongly to one side, small ones and rest rightly.
    Source: the second-order term of a potentiometer's characteristic, loaded or off its axis, and the third.
    """

    curvature: float = parameter(0.1, unit="1/{y}", null=0.0, lower=-20.0, upper=20.0, scale=0.05)
    place: float = parameter(0.0, lower=0.0, upper=2.0, grid=(0.0, 1.0, 2.0), fitted=False)
    skew_per_rad: float = refinement(
        0.0,
        unit="1/{y}",
        lower=-20.0,
        upper=20.0,
        scale=0.5,
        grid=(0.5, -0.5),
        times="curvature",
        words="not alike both ways",
    )

    name, stage, signal, rigs = "sensor_nonlinearity", Stage.SENSOR, "reading", ("ankle", "joint")

    def smallest(self, measured: Measured) -> dict[str, float]:
        """No size where the reading passes more than a turn."""
        turns = "position" in measured and np.ptp(measured["position"]) > TURN
        return {"curvature": self.parameters()["curvature"].upper} if turns else {}

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        x = value - counted_from(s, self.place)
        return value + self.curvature * x * x * (1.0 + self.skew_per_rad * x)
