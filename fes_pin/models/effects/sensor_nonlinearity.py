"""Curvature of the sensor's characteristic."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fes_pin.models.parameters import parameter
from fes_pin.models.stage import Effect, Stage


@dataclass(frozen=True)
class SensorNonlinearity(Effect):
    """Curvature of the sensor's characteristic.

        y + curvature (y - y_rest)^2

    Tell-tale: large excursions are read wrongly to one side, small ones and rest rightly.
    Source: the second-order term of a potentiometer's characteristic, loaded or off its axis.
    """

    curvature: float = parameter(0.1, unit="1/rad", null=0.0, lower=-20.0, upper=20.0, scale=0.05)

    name, stage, signal, rigs = "sensor_nonlinearity", Stage.SENSOR, "reading", ("ankle", "joint")

    def apply(self, value: Any, s: Any) -> Any:
        away = value - s.rest_reading
        return value + self.curvature * away * away
