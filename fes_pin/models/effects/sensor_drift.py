"""A ramp in time added to the measured output of a trial."""

from dataclasses import dataclass

import numpy as np

from fes_pin.models.maths import TURN
from fes_pin.models.parameters import parameter, refinement
from fes_pin.models.stage import Bounds, Effect, Measured, Scalar, Signals, Stage


@dataclass(frozen=True)
class SensorDrift(Effect):
    """A ramp in time added to the measured output of a trial.

        y + rate t / (1 + settling t),   t from the first sample of the trial

    Tell-tale: readings at equal states move apart steadily within a trial, whatever happens.
    Source: the warming of a bridge or of its amplifier.
    """

    rate_per_s: float = parameter(0.001, unit="{y}/s", null=0.0, scale=0.0005)
    settling_per_s: float = refinement(
        0.0, unit="1/s", lower=0.0, upper=10.0, scale=0.1, grid=(0.2,), words="which levels off"
    )

    name, stage, signal, rigs = "sensor_drift", Stage.SENSOR, "reading", ("ankle", "joint", "muscle")

    def limits(self, measured: Measured) -> Bounds:
        """Return bounds of the rate: within a trial no more than its readings differ, and no angle by more than a turn.

        An absolute angle sensor repeats after a turn, and an incremental one counts.
        """
        time, reading = measured.get("time", np.zeros(1)), measured.get("reading", np.zeros(1))
        longest, most = float(np.max(time)), float(np.nanmax(reading) - np.nanmin(reading))
        most = min(most, TURN) if "position" in measured else most
        return {"rate_per_s": (-most / longest, most / longest)} if longest > 0.0 and most > 0.0 else {}

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value + self.rate_per_s * s.time / (1.0 + self.settling_per_s * s.time)
