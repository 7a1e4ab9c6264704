"""Deviations of the output from its rest value are scaled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fes_pin.models.parameters import parameter
from fes_pin.models.stage import Effect, Stage


@dataclass(frozen=True)
class SensorGain(Effect):
    """Deviations of the output from its rest value are scaled.

        y_rest + (1 + error) (y - y_rest)

    Tell-tale: every excursion is too large or too small by the same factor, rest angles are right.
    Source: a potentiometer's supply or an amplifier's gain that is off.
    """

    error: float = parameter(0.05, null=0.0, lower=-0.9, upper=9.0, scale=0.02)

    name, stage, signal, rigs = "sensor_gain", Stage.SENSOR, "reading", ("ankle", "joint")

    def apply(self, value: Any, s: Any) -> Any:
        return value + self.error * (value - s.rest_reading)
