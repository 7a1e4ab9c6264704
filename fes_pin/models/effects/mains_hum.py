"""A sinusoid at the mains frequency in the measured output."""

from dataclasses import dataclass

from fes_pin.models.maths import TURN, cos, sin
from fes_pin.models.stage import Effect, Scalar, Signals, Stage, parameter


@dataclass(frozen=True)
class MainsHum(Effect):
    """A sinusoid at the mains frequency in the measured output.

        y + in_phase sin(2 pi f t) + quadrature cos(2 pi f t)

    Tell-tale: a steady ripple at 50 or 60 Hz (or where sampling folds it to) that is there at rest as well.
    Source: capacitive pick-up from the mains; the frequency is 50 or 60 Hz by country. Trials cut from one recording
    may share the phase; others begin at any phase, and both amplitudes are each trial's own.
    """

    in_phase: float = parameter(0.001, unit="{y}", null=0.0, scale=0.001)
    quadrature: float = parameter(0.0, unit="{y}", null=0.0, scale=0.001)
    frequency_hz: float = parameter(50.0, unit="Hz", grid=(50.0, 60.0), fitted=False)

    name, stage, signal, rigs = "mains_hum", Stage.SENSOR, "reading", ("ankle", "joint", "muscle")
    varies = True

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        phase = TURN * self.frequency_hz * s.time
        return value + self.in_phase * sin(phase) + self.quadrature * cos(phase)
