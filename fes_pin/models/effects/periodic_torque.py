"""A slow periodic external torque, as of breathing."""

from dataclasses import dataclass

import numpy as np

from fes_pin.models.maths import TURN, cos, sin
from fes_pin.models.stage import Bounds, Effect, Grids, Measured, Scalar, Signals, Stage, parameter

FASTEST_HZ = 0.8
"""The fastest breathing that is looked for; see the source below."""


@dataclass(frozen=True)
class PeriodicTorque(Effect):
    """A slow periodic external torque, as of breathing.

        torque + in_phase sin(2 pi frequency t) + quadrature cos(2 pi frequency t)

    Tell-tale: the rest angle sways in time with nothing that was commanded.
    Source: a Fourier component at the breathing rate: at rest 12 to 20 a minute in people, 10 to 35 in dogs, and up
    to 0.8 Hz; the phase is that of the trial's first sample. A trial that does not begin with a breath has its own.
    """

    in_phase: float = parameter(0.01, unit="{effort}", null=0.0, lower=-1e6, upper=1e6, scale=0.005)
    quadrature: float = parameter(0.0, unit="{effort}", null=0.0, lower=-1e6, upper=1e6, scale=0.005)
    frequency_hz: float = parameter(
        0.4, unit="Hz", lower=0.05, upper=FASTEST_HZ, scale=0.02, grid=tuple(k / 20 for k in range(2, 16))
    )

    name, stage, signal, rigs = "periodic_torque", Stage.RIG, "torque", ("ankle", "joint")
    varies = True

    @classmethod
    def grids(cls, measured: Measured) -> Grids:
        """The frequencies of which a trial holds a period."""
        grids = super().grids(measured)
        slowest = _slowest(measured)
        return {**grids, "frequency_hz": tuple(f for f in grids["frequency_hz"] if f >= slowest) or (FASTEST_HZ,)}

    def limits(self, measured: Measured) -> Bounds:
        """At least one period in a trial: a slower torque, with a phase of each trial's own, can replace any slow
        effect."""
        return {"frequency_hz": (_slowest(measured), FASTEST_HZ)}

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        phase = TURN * self.frequency_hz * s.time
        return value + self.in_phase * sin(phase) + self.quadrature * cos(phase)


def _slowest(measured: Measured) -> float:
    return min(1.0 / float(np.max(measured["time"])), FASTEST_HZ)
