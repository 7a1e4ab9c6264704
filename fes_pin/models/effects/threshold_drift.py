"""The threshold moves with time within a trial, stimulated or not."""

from dataclasses import dataclass

from fes_pin.models.stage import Effect, Scalar, Signals, Stage, parameter, refinement


@dataclass(frozen=True)
class ThresholdDrift(Effect):
    """The threshold moves with time within a trial, stimulated or not.

        w_eff = w - rate t / (1 + settling t),   t from the first sample of the trial

    Tell-tale: equal stimuli are answered ever more weakly (or strongly) within a trial, the more so near the
    threshold, and rest does not help.
    Source: Popovic and Sinkjaer, Control of Movement for the Physically Disabled, Springer 2000: electrodes that
    move or dry.
    """

    rate_us_per_s: float = parameter(2.0, unit="us/s", null=0.0, lower=-100.0, upper=100.0, scale=2.0)
    settling_per_s: float = refinement(
        0.0, unit="1/s", lower=0.0, upper=10.0, scale=0.1, grid=(0.2,), words="ever more slowly"
    )

    name, stage, signal, rigs = "threshold_drift", Stage.NERVE, "pulse_width", ("ankle", "muscle")

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value - self.rate_us_per_s * s.time / (1.0 + self.settling_per_s * s.time)
