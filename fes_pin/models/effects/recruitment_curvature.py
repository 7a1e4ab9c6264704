"""Recruitment between threshold and saturation is not linear."""

from dataclasses import dataclass

from fes_pin.models.maths import exp, log, maximum
from fes_pin.models.stage import Effect, Scalar, Signals, Stage, parameter

R_SMALL = 1e-6
"""Recruitment below which its power is linear: a millionth of the muscle."""


@dataclass(frozen=True)
class RecruitmentCurvature(Effect):
    """Recruitment between threshold and saturation is not linear.

        r' = (1 + e) r^n / (1 + e r^n),   n = exp(log_exponent), e = exp(log_bend) - 1

    Tell-tale: small stimuli are answered too strongly or too weakly against large ones, at every angle and speed
    alike.
    Source: Hill's function, normalised to 1 at saturation: log_exponent 0 bends one way (as Ding's 1 - exp(-(w -
    w0) / w_t)), above 0 it is a sigmoid. Durfee and MacLean, IEEE Trans. Biomed. Eng. 36 (1989), measured such
    curves.
    """

    log_exponent: float = parameter(0.1, null=0.0, lower=-1.2, upper=2.0, scale=0.1)
    log_bend: float = parameter(0.2, null=0.0, lower=-3.0, upper=5.0, scale=0.2)

    name, stage, signal, rigs = "recruitment_curvature", Stage.NERVE, "recruitment", ("ankle", "muscle")

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        n, bend = exp(self.log_exponent), exp(self.log_bend)
        power = value * exp((n - 1.0) * log(maximum(value, R_SMALL)))
        return bend * power / (1.0 + (bend - 1.0) * power)
