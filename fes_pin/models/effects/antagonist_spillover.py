"""Above some pulse width the stimulus also recruits the antagonist."""

from dataclasses import dataclass

from fes_pin.models.maths import clip, lag, maximum
from fes_pin.models.stage import ByName, Effect, Scalar, Signals, Stage, parameter, refinement


@dataclass(frozen=True)
class AntagonistSpillover(Effect):
    """Above some pulse width the stimulus also recruits the antagonist.

        r_s     = clip((w - onset) / (saturation - onset), 0, 1)
        lag b'  = r_s - b                         with lag_s
        b       = r_s                             without lag_s
        F_net   = F_M - share K F_ref b

    Tell-tale: the strongest stimuli move the joint less than weaker ones predict, though the muscle alone pulls as
    modelled.
    Source: Popovic and Sinkjaer, Control of Movement for the Physically Disabled, Springer 2000: spread of current
    to neighbouring nerves. The antagonist answers at once unless data show its lag.
    """

    share: float = parameter(0.05, null=0.0, lower=0.0, upper=2.0, scale=0.05)
    onset_us: float = parameter(
        600.0, unit="us", lower=0.0, upper=2000.0, scale=50.0, grid=(300.0, 450.0, 600.0, 750.0, 900.0)
    )
    lag_s: float = refinement(0.0, unit="s", lower=0.0, upper=0.5, scale=0.02, grid=(0.05,), words="which answers late")

    name, stage, signal, rigs = "antagonist_spillover", Stage.NERVE, "net_force", ("ankle",)
    states = ("act",)
    memories = ("recruited",)

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value - self.share * s.force_scale * lag(s.own.recruited, s.own.act, self.lag_s, s.step)[0]

    def rate(self, s: Signals) -> ByName:
        return {"act": lag(s.own.recruited, s.own.act, self.lag_s, s.step)[1]}

    def update(self, s: Signals) -> ByName:
        room = maximum(s.saturation - self.onset_us, s.least)
        return {"recruited": clip((s.commanded - self.onset_us) / room, 0.0, 1.0)}
