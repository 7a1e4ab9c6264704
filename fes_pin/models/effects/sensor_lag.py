"""The output is read late."""

from dataclasses import dataclass

from fes_pin.models.maths import lag, lag_time
from fes_pin.models.stage import ByName, Effect, Measured, Scalar, Signals, Stage, least_step, parameter, refinement


@dataclass(frozen=True)
class SensorLag(Effect):
    """The output is read late.

        b z' = y - z,   y replaced by z + shift (z - y),   b = lag / (1 + shift)

    The reading is late by `lag_s`. It is a first-order low pass at shift 0, and at shift 1 the all-pass
    (1 - b s) / (1 + b s): a pure delay to second order in s. Where nothing but the stimulus drives the rig a shift of
    the reading's clock is an electromechanical delay in all that it does, and has that name.

    Tell-tale: every motion is read late, in proportion to its speed, stimulated or not.
    Source: an anti-aliasing filter, or clocks that differ. All-pass: Pade's approximant of a delay, of order (1, 1).
    """

    lag_s: float = parameter(0.005, unit="s", null=0.0, lower=0.0, upper=0.5, scale=0.005)
    shift: float = refinement(
        0.0, lower=0.0, upper=1.0, scale=1.0, fitted=False, grid=(1.0,), rigs=("joint",), words="by a shift in time"
    )

    name, stage, signal, rigs = "sensor_lag", Stage.SENSOR, "reading", ("ankle", "joint", "muscle")
    states = ("filtered",)
    max_step_s = 1.25e-3

    def smallest(self, measured: Measured) -> dict[str, float]:
        """Half a row of a controller's log, which does not say when in it the effort answered the reading."""
        return {"lag_s": 0.5 * least_step(measured["time"])} if "answer" in measured else {}

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value + (1.0 + self.shift) * (self._lagged(s)[0] - s.sensed)

    def rate(self, s: Signals) -> ByName:
        return {"filtered": self._lagged(s)[1]}

    def rest(self, s: Signals) -> ByName:
        return {"filtered": s.sensed - lag_time(self._lag(), s.step) * s.sensed_rate}

    def start_variances(self, reach: Scalar, speed: Scalar) -> ByName:
        """Return the variance of the initial lag, which is unknown in trials that begin in motion."""
        return {"filtered": (self._lag() * speed) ** 2}

    def _lagged(self, s: Signals) -> tuple[Scalar, Scalar]:
        return lag(s.sensed, s.own.filtered, self._lag(), s.step)

    def _lag(self) -> Scalar:
        return self.lag_s / (1.0 + self.shift)
