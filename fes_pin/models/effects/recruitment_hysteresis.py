"""Recruitment depends on the direction in which the pulse width came."""

from dataclasses import dataclass

from fes_pin.models.maths import play
from fes_pin.models.stage import ByName, Effect, Scalar, Signals, Stage, parameter


@dataclass(frozen=True)
class RecruitmentHysteresis(Effect):
    """Recruitment depends on the direction in which the pulse width came.

        b+    = clip(b, w - half_width, w + half_width)      play, once per sample
        w_eff = b+

    Tell-tale: the same pulse width gives less force on the way up than on the way down, however slowly it changes.
    Source: Dombre, Fournier and Coiffet, section I, which names it among what must be identified. Play:
    Krasnosel'skii and Pokrovskii, Systems with Hysteresis, Springer 1989.
    """

    half_width_us: float = parameter(10.0, unit="us", null=0.0, lower=0.0, upper=400.0, scale=10.0)

    name, stage, signal, rigs = "recruitment_hysteresis", Stage.NERVE, "pulse_width", ("ankle", "muscle")
    memories = ("followed",)

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return play(s.own.followed, value, self.half_width_us)

    def update(self, s: Signals) -> ByName:
        return {"followed": play(s.own.followed, s.commanded, self.half_width_us)}
