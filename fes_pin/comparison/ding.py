"""Force of a pulse train after Ding, Wexler and Binder-Macleod (2003): troponin, then a force of its own dynamics."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fes_pin.models.maths import exp, where
from fes_pin.models.parameters import parameter
from fes_pin.models.stage import Effect, Stage

TAU_C_S = 0.020
"""Time constant of calcium and troponin, s: Ding et al. 2003, held for all subjects."""
TAU_1_S = 0.050957
"""Time constant of the force without strong cross bridges, s: Ding et al. 2000, at rest; it also scales `gain`."""
TAU_2_S = 0.060
"""Increase of it by strong cross bridges, s: about that of Ding et al. 2000."""
K_M = 0.103
"""Half saturation of troponin at rest: Ding et al. 2000."""
R_0 = 1.04
"""Difference of R_0 and K_m: Ding et al. 2003."""


@dataclass(frozen=True)
class Ding2003(Effect):
    """Calcium released by pulses binds to troponin; the force it drives decays the slower the more there is.

        tau_c dC_N/dt = sum_i R_i exp(-(t - t_i) / tau_c) - C_N
        R_i           = 1 + (K_m + 1.04 - 1) exp(-(t_i - t_(i-1)) / tau_c),   R_1 = 1
        x             = C_N / (K_m + C_N)
        dF/dt         = A x - F / (tau_1 + tau_2 x)

    It stands in the place of the nominal activation: F = gain y, with A = gain / 51 ms, and tau_c the rig's time
    constant. Pulses must have been recorded.

    Tell-tale: force saturates at high rates, and falls the later the more of it there was.
    Source: Ding, Wexler and Binder-Macleod, J. Electromyogr. Kinesiol. 13 (2003) 575; constants at rest: the same,
    J. Appl. Physiol. 88 (2000) 917.
    """

    half_saturation: float = parameter(K_M, lower=1e-3, upper=50.0, scale=0.05)
    tau_1_s: float = parameter(TAU_1_S, unit="s", lower=2e-3, upper=2.0, scale=0.01)
    tau_2_s: float = parameter(TAU_2_S, unit="s", lower=0.0, upper=2.0, scale=0.01)

    name, stage, signal, rigs = "ding2003", Stage.MUSCLE, "activation", ("muscle",)
    states = ("calcium", "troponin", "tension")
    memories = ("primed", "weight")
    max_step_s = 1.25e-3

    def apply(self, value: Any, s: Any) -> Any:
        return s.own.tension

    def update(self, s: Any) -> Mapping[str, Any]:
        pulse = s.u.stim > 0.0
        earlier = s.own.primed * exp(-s.c.dt / TAU_C_S)
        weight = 1.0 + (self.half_saturation + R_0 - 1.0) * earlier
        return {"weight": weight, "primed": where(pulse, 1.0, earlier)}

    def rest(self, s: Any) -> Mapping[str, Any]:
        return {"weight": 1.0}

    def rate(self, s: Any) -> Mapping[str, Any]:
        own, tau_c = s.own, TAU_C_S
        bound = own.troponin / (self.half_saturation + own.troponin)
        return {
            "calcium": own.weight * s.r / s.c.pulse_period_s - own.calcium / tau_c,
            "troponin": (own.calcium - own.troponin) / tau_c,
            "tension": bound / TAU_1_S - own.tension / (self.tau_1_s + self.tau_2_s * bound),
        }
