"""Threshold and saturation sit at other pulse widths than believed."""

from dataclasses import dataclass

from fes_pin.models.stage import Effect, Scalar, Signals, Stage, parameter


@dataclass(frozen=True)
class ThresholdShift(Effect):
    """Threshold and saturation sit at other pulse widths than believed.

        r = clip((w - shift - threshold) / (saturation - threshold), 0, 1)

    Tell-tale: the smallest and the largest stimuli are answered wrongly, those beyond both are not.
    Source: Dombre, Fournier and Coiffet, section II-3-1: both widths are found by experiment, electrode by
    electrode.
    """

    shift_us: float = parameter(20.0, unit="us", null=0.0, lower=-400.0, upper=400.0, scale=20.0)

    name, stage, signal, rigs = "threshold_shift", Stage.NERVE, "pulse_width", ("ankle", "muscle")

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value - self.shift_us
