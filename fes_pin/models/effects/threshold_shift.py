"""Threshold and saturation sit at other pulse widths than believed."""

from dataclasses import dataclass

import numpy as np

from fes_pin.data.channels import CHANNELS
from fes_pin.models.stage import Bounds, Effect, Measured, Scalar, Signals, Stage, parameter


@dataclass(frozen=True)
class ThresholdShift(Effect):
    """Threshold and saturation sit at other pulse widths than believed.

        r = clip((w - shift - threshold) / (saturation - threshold), 0, 1)

    Tell-tale: the smallest and the largest stimuli are answered wrongly, those beyond both are not.
    Source: Dombre, Fournier and Coiffet, section II-3-1: both widths are found by experiment, electrode by
    electrode.
    """

    shift_us: float = parameter(20.0, unit="us", null=0.0, lower=-1e4, upper=1e4, scale=20.0)

    name, stage, signal, rigs = "threshold_shift", Stage.NERVE, "pulse_width", ("ankle", "muscle")

    def limits(self, measured: Measured) -> Bounds:
        """Beyond the widest pulse no stimulus acts, or each does fully."""
        widest = max((float(np.max(measured[n])) for n in CHANNELS if n in measured), default=0.0)
        return {"shift_us": (-widest, widest)} if widest > 0.0 else {}

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value - self.shift_us
