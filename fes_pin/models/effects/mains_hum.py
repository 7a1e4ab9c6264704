"""A sinusoid at the mains frequency in the measured output."""

from dataclasses import dataclass

import numpy as np

from fes_pin.models.maths import TURN, cos, sin
from fes_pin.models.stage import Effect, Grids, Measured, Scalar, Signals, Stage, parameter


@dataclass(frozen=True)
class MainsHum(Effect):
    """A sinusoid at the mains frequency in the measured output.

        y + in_phase sin(2 pi frequency t) + quadrature cos(2 pi frequency t)

    Tell-tale: a steady ripple at 50 or 60 Hz (or where sampling folds it to) that is there at rest as well.
    Source: capacitive pick-up from the mains; the frequency is 50 or 60 Hz by country. Trials cut from one recording
    may share the phase; others begin at any phase, and both amplitudes are each trial's own.
    """

    in_phase: float = parameter(0.001, unit="{y}", null=0.0, scale=0.001)
    quadrature: float = parameter(0.0, unit="{y}", null=0.0, scale=0.001)
    frequency_hz: float = parameter(50.0, unit="Hz", grid=(50.0, 60.0), fitted=False)

    name, stage, signal, rigs = "mains_hum", Stage.SENSOR, "reading", ("ankle", "joint", "muscle")
    varies = True

    @classmethod
    def grids(cls, measured: Measured) -> Grids:
        """The frequencies that sampling does not fold to less than a period in a trial: these would be an offset."""
        grids, time = super().grids(measured), measured.get("time", np.empty(0))
        if len(time) < 2:
            return grids
        rate = 1.0 / float(np.median(np.diff(time)))
        folded = {f: abs(f - rate * round(f / rate)) for f in grids["frequency_hz"]}
        return {**grids, "frequency_hz": tuple(f for f, seen in folded.items() if seen * np.max(time) >= 1.0)}

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        phase = TURN * self.frequency_hz * s.time
        return value + self.in_phase * sin(phase) + self.quadrature * cos(phase)
