"""A first-order low pass between the output and its reading."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fes_pin.models.parameters import parameter
from fes_pin.models.stage import Effect, Stage, lag


@dataclass(frozen=True)
class SensorLag(Effect):
    """A first-order low pass between the output and its reading.

        lag z' = y - z,   z replaces y

    Tell-tale: every motion is read late, in proportion to its speed, stimulated or not.
    Source: an anti-aliasing filter, or clocks that differ: both are a delay to first order.
    """

    lag_s: float = parameter(0.005, unit="s", null=0.0, lower=0.0, upper=0.5, scale=0.005, grid=(0.005, 0.02))

    name, stage, signal, rigs = "sensor_lag", Stage.SENSOR, "reading", ("ankle", "joint", "muscle")
    states = ("filtered",)

    def apply(self, value: Any, s: Any) -> Any:
        return value + (lag(s.sensed, s.own.filtered, self.lag_s, s.step)[0] - s.sensed)

    def rate(self, s: Any) -> Mapping[str, Any]:
        return {"filtered": lag(s.sensed, s.own.filtered, self.lag_s, s.step)[1]}

    def rest(self, s: Any) -> Mapping[str, Any]:
        return {"filtered": s.sensed}
