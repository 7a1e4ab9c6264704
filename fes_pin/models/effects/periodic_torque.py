"""A slow periodic external torque, as of breathing."""

from dataclasses import dataclass

import numpy as np

from fes_pin.models.maths import TURN, cos, sin
from fes_pin.models.stage import Bounds, Effect, Grids, Measured, Scalar, Signals, Stage, parameter

FASTEST_HZ = 0.8
"""The fastest breathing that is looked for; see the source below."""
SAME = 0.5
"""Share of the variance of a driven motion that has the period of a torque, from which it is the motion's own."""


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

    def smallest(self, measured: Measured) -> dict[str, float]:
        """No size where a joint that is driven moves with the same period: any torque of such a motion has it too."""
        if not {"effort", "position"} <= {*measured} or _share(measured, self.frequency_hz) < SAME:
            return {}
        return {n: self.parameters()[n].upper for n in self.amplitudes()}

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        phase = TURN * self.frequency_hz * s.time
        return value + self.in_phase * sin(phase) + self.quadrature * cos(phase)


def _slowest(measured: Measured) -> float:
    return min(1.0 / float(np.max(measured["time"])), FASTEST_HZ)


def _share(measured: Measured, frequency_hz: float) -> float:
    """Return the share of the variance of the position that a sine of each trial's own explains."""
    starts = np.flatnonzero(np.diff(measured["time"], prepend=np.inf) < 0.0)
    squares = left = 0.0
    for time, position in zip(*(np.split(measured[n], starts[1:]) for n in ("time", "position")), strict=True):
        phase = TURN * frequency_hz * time
        columns = np.column_stack([np.ones_like(time), np.sin(phase), np.cos(phase)])
        missed = position - columns @ np.linalg.lstsq(columns, position, rcond=None)[0]
        squares, left = squares + float(np.sum((position - position.mean()) ** 2)), left + float(missed @ missed)
    return 1.0 - left / squares if squares > 0.0 else 0.0
