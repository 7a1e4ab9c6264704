"""Models of stimulated muscle from the literature: the nominal model with compositions of effects.

A composition keeps the nominal recruitment and the rig; what a publication has beyond that is named, and so is what it
has not in common with it. Start values are the publication's where it has any; all parameters are fitted. Of Ding,
Wexler and Binder-Macleod (2003) the force of a pulse train is an effect of its own: troponin, then a force of its own
dynamics.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial
from fes_pin.models.effects.electromechanical_delay import ElectromechanicalDelay
from fes_pin.models.effects.fatigue import Fatigue
from fes_pin.models.effects.force_length import ForceLength
from fes_pin.models.effects.force_velocity import ForceVelocity
from fes_pin.models.effects.pulse_summation import PulseSummation
from fes_pin.models.effects.recruitment_curvature import RecruitmentCurvature
from fes_pin.models.effects.rise_fall_asymmetry import RiseFallAsymmetry
from fes_pin.models.effects.second_order_activation import SecondOrderActivation
from fes_pin.models.effects.series_elasticity import SeriesElasticity
from fes_pin.models.maths import exp, where
from fes_pin.models.model import Model
from fes_pin.models.parameters import parameter
from fes_pin.models.stage import Effect, Stage

TAU_C_S = 0.020
"""Time constant of calcium and troponin, s: Ding et al. 2003, held for all subjects."""
MAX_STEP_S = TAU_C_S / 16.0
"""Longest step of integration, s: a sixteenth of the shortest time constant."""
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
    max_step_s = MAX_STEP_S

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


NOMINAL = "nominal"
"""Name of the study's own believed model."""
RIGS = ("muscle", "ankle")
"""Rigs that a stimulated muscle drives."""
HILL = 4.0
"""F_0 / a of Hill's hyperbola: Hill, Proc. R. Soc. B 126 (1938)."""
CALCIUM_S = 0.04
"""Time constant of calcium, s: Riener and Fuhr 1998."""
DELAY_S = 0.025
"""From pulse to force, s: Riener and Fuhr 1998."""
RECOVERY_S = 30.0
"""Time constants of fatigue, s: Riener and Fuhr 1998."""


@dataclass(frozen=True)
class Published:
    """A model of the literature.

    Attributes
    ----------
    name
        What it is asked for by.
    words
        What it is made of, one line.
    source
        Where it was published.
    effects
        Makes them with start values, for these trials.
    pulses
        True if single pulses must have been recorded.
    fixed
        Nominal parameters that are held, with their values.
    """

    name: str
    words: str
    source: str
    effects: Callable[[Sequence[Trial]], tuple[Effect, ...]]
    pulses: bool = False
    fixed: tuple[tuple[str, float], ...] = ()

    def model(self, nominal: Model, trials: Sequence[Trial]) -> Model:
        """The model on a rig, with the effects that act in these trials.

        Raises
        ------
        InputError
            If it needs pulses, and they were not recorded.
        """
        if self.pulses and not all("stim" in t for t in trials):
            raise InputError(f"{self.name} needs single pulses: expected a column stim in every trial")
        rig = nominal.rig
        if self.fixed:
            held = dict(self.fixed)
            left = tuple(n for n in rig.fitted_parameters() if n not in held)
            rig = replace(nominal.with_parameters(held).rig, fitted=left)
        signals = {name for t in trials for name in rig.changeable(t.kind, rig.input_columns(t))}
        return Model(rig, tuple(e for e in self.effects(trials) if rig.takes(e) and e.signal in signals))

    def unfelt(self, model: Model, trials: Sequence[Trial]) -> tuple[str, ...]:
        """Names of its effects that are not in its model, as they act in none of these trials."""
        felt = [e.name for e in model.effects]
        return tuple(e.name for e in self.effects(trials) if e.name not in felt)


def _contractile(trials: Sequence[Trial]) -> tuple[Effect, ...]:
    """Force over length and velocity and the tendon; of a lever in sizes that its way and the force suggest."""
    levered = [t for t in trials if t.kind == IMPOSED and "length_m" in t]
    if not levered:
        return (ForceLength(), ForceVelocity(), SeriesElasticity())
    length = np.concatenate([t["length_m"] for t in levered])
    speed = np.concatenate([np.abs(np.gradient(t["length_m"], t.dt)) for t in levered])
    force = max(float(np.nanmax([np.nanmax(t["force_n"]) for t in levered])), 1e-9)
    way = max(float(np.ptp(length)), 1e-9)
    fastest = max(float(np.quantile(speed, 0.99)), 1e-9)
    over_length = ForceLength(slope_per_rad=0.0, curvature_per_rad2=1.0 / way**2)
    over_velocity = ForceVelocity(slope_s_per_rad=1.0 / fastest, hill=HILL)
    return over_length, over_velocity, SeriesElasticity(compliance=0.05 * way / force)


LITERATURE: tuple[Published, ...] = (
    Published(NOMINAL, "", "", lambda _: ()),
    Published(
        "second_order",
        "two lags in series",
        "Baratta and Solomonow, IEEE Trans. Biomed. Eng. 37 (1990) 109",
        lambda _: (SecondOrderActivation(second_s=0.02),),
    ),
    Published(
        "hammerstein",
        "a curve of recruitment before two lags in series",
        "Durfee and MacLean, IEEE Trans. Biomed. Eng. 36 (1989) 292",
        lambda _: (RecruitmentCurvature(), SecondOrderActivation(second_s=0.02)),
    ),
    Published(
        "hill",
        "activation that rises and falls with different times; force-length, force-velocity, tendon",
        "Zajac, Crit. Rev. Biomed. Eng. 17 (1989) 359; Hill, Proc. R. Soc. B 126 (1938) 136",
        lambda trials: (RiseFallAsymmetry(), *_contractile(trials)),
    ),
    Published(
        "riener",
        "delay, two lags of calcium, force-length, force-velocity, fatigue that recovers; the nominal recruitment",
        "Riener and Fuhr, IEEE Trans. Rehab. Eng. 6 (1998) 113",
        lambda trials: (
            ElectromechanicalDelay(delay_s=DELAY_S),
            SecondOrderActivation(second_s=CALCIUM_S),
            *(e for e in _contractile(trials) if e.name != SeriesElasticity.name),
            Fatigue(recovery_s=RECOVERY_S),
        ),
    ),
    Published(
        "bobet_stein",
        "a lag, a saturating power of it, a second lag whose rate here does not depend on the force",
        "Bobet and Stein, IEEE Trans. Biomed. Eng. 45 (1998) 1010",
        lambda _: (PulseSummation(saturation=1.0, cooperation=1.0), SecondOrderActivation(second_s=0.03)),
    ),
    Published(
        "ding2003",
        "calcium of each pulse, troponin, a force whose decay it slows; without its fatigue between trains",
        "Ding, Wexler and Binder-Macleod, J. Electromyogr. Kinesiol. 13 (2003) 575",
        lambda _: (Ding2003(),),
        pulses=True,
        fixed=(("time_constant_s", 0.02),),
    ),
)
"""In the order in which they are listed, the study's own first."""


def published_model(name: str) -> Published:
    """The model of that name.

    Raises
    ------
    InputError
        If there is none.
    """
    known = {m.name: m for m in LITERATURE}
    if name not in known:
        raise InputError(f"no model {name!r}; expected some of {', '.join(known)}", column="models")
    return known[name]


def possible(trials: Sequence[Trial]) -> tuple[str, ...]:
    """Names of the models that can be fitted to these trials, the nominal first."""
    pulsed = all("stim" in t for t in trials)
    return tuple(m.name for m in LITERATURE if pulsed or not m.pulses)
