"""Deviations of the output from its rest value are scaled."""

from dataclasses import dataclass

from fes_pin.models.stage import FromAPlace, Scalar, Signals, Stage, counted_from, parameter


@dataclass(frozen=True)
class SensorGain(FromAPlace):
    """Deviations of the output from its rest value are scaled.

        y_rest + (1 + error) (y - y_rest)

    On a joint y_rest is where a trial begins (`place` 0), where no effort need hold the joint (1), or the zero of its
    URDF (2), whichever fits.

    An error beyond a factor of two is another unit, not a gain.

    Tell-tale: every excursion is too large or too small by the same factor, rest angles are right.
    Source: a potentiometer's supply or an amplifier's gain that is off.
    """

    error: float = parameter(0.05, null=0.0, lower=-0.5, upper=1.0, scale=0.02)
    place: float = parameter(0.0, lower=0.0, upper=2.0, grid=(0.0, 1.0, 2.0), fitted=False)

    name, stage, signal, rigs = "sensor_gain", Stage.SENSOR, "reading", ("ankle", "joint")
    scales = True

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value + self.error * (value - counted_from(s, self.place))
