"""A constant added to the measured output."""

from dataclasses import dataclass

from fes_pin.models.stage import Effect, Scalar, Signals, Stage, parameter


@dataclass(frozen=True)
class SensorOffset(Effect):
    """A constant added to the measured output.

        y + offset

    Tell-tale: every reading is off by the same amount, at rest and in motion.
    Source: a potentiometer or bridge that was not zeroed.
    """

    offset: float = parameter(0.01, unit="{y}", null=0.0, scale=0.005)

    name, stage, signal, rigs = "sensor_offset", Stage.SENSOR, "reading", ("ankle", "joint", "muscle")
    of_record = True

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value + self.offset
