"""Small rigs, trials and model structures that the tests of the engine share."""

import numpy as np
import pinocchio as pin

from fes_pin.data.trial import Trial
from fes_pin.models.compile import program
from fes_pin.models.effects import EFFECTS, effects_for
from fes_pin.models.model import Model
from fes_pin.models.rigs import Ankle, Joint, Muscle
from fes_pin.models.rigs.rigid import point_foot

ANKLE = {
    "foot_mass_kg": 0.12,
    "com_distance_m": 0.08,
    "moment_arm_m": 0.034,
    "force_scale_n": 56.0,
    "threshold_us": 180.0,
    "saturation_us": 1000.0,
    "f0_n": 4.0,
    "f1_per_rad": 2.2,
    "theta_r_rad": 1.3,
}
JOINT = {"inertia": 0.02, "gravity_cos": 0.1, "gravity_sin": 0.6, "revolute": 1.0}
MUSCLE = {"threshold_us": 100.0, "saturation_us": 500.0, "length_m": 0.045}
RIGS = {
    "ankle": Ankle(0.65, 0.05, 1.05e-3, 0.06, constants=ANKLE),
    "joint": Joint(1.1, 0.02, 0.95, constants=JOINT),
    "muscle": Muscle(30.0, 0.06, constants=MUSCLE),
}
KINDS = {"ankle": ("motion", "isometric"), "joint": ("motion",), "muscle": ("isometric",)}

EFFECTS_OF_RIGS = [(effect, rig) for effect in EFFECTS for rig in effect.rigs]
"""Every effect with every rig that it names: what the contract tests run over."""

CASES = [
    (effect, rig, kind)
    for effect, rig in EFFECTS_OF_RIGS
    for kind in KINDS[rig]
    if effect.signal in RIGS[rig].signals(kind)
]
"""The same with every kind of trial that can feel the effect, but for imposed motion."""

FELT = [(effect, rig) for effect, rig in EFFECTS_OF_RIGS if any((e, r) == (effect, rig) for e, r, _ in CASES)]
"""Every effect with every rig that feels it in some trial whose motion is not imposed."""

IMPOSED_CASES = [
    (effect, rig, "imposed")
    for effect, rig in EFFECTS_OF_RIGS
    if "imposed" in RIGS[rig].schema.outputs and effect.signal in RIGS[rig].signals("imposed")
]
"""The same where the motion is imposed."""


def name_of(value):
    """Test ids: names of effects instead of their classes."""
    return getattr(value, "name", str(value))


def pulses(rng, n, low, high, dt=5e-3):
    """Steps of random height and length, the first third of a second at zero."""
    width, k = np.zeros(n), round(0.1 / dt)
    while k < n:
        length = int(rng.integers(3, max(4, round(0.8 / dt))))
        width[k : k + length] = rng.choice([0.0, 1.0], p=[0.2, 0.8]) * rng.uniform(low, high)
        k += length
    return width


def trial(rig, kind, rng, n=300, dt=5e-3, **conditions):
    """A random trial without measured outputs."""
    time = np.arange(n) * dt
    if rig == "ankle":
        columns = {"pulse_width_us": pulses(rng, n, 150.0, 950.0, dt)}
        if kind == "imposed":
            columns["angle_rad"] = 1.7 + sum(
                rng.uniform(0.05, 0.2) * np.sin(rng.uniform(2.0, 8.0) * time + rng.uniform(0.0, 6.0)) for _ in range(2)
            )
        held = {"motion": {"load_kg": rng.uniform(0.8, 1.6)}, "isometric": {"angle_rad": rng.uniform(1.5, 2.1)}}
        conditions = held.get(kind, {"load_kg": 0.5})
    elif rig == "muscle":
        columns = {"pulse_width_us": pulses(rng, n, 80.0, 520.0, dt)}
        if kind == "imposed":
            columns["length_m"] = 0.045 + sum(
                rng.uniform(0.5e-3, 2e-3) * np.sin(rng.uniform(1.0, 8.0) * time + rng.uniform(0.0, 6.0))
                for _ in range(2)
            )
    elif kind == "imposed":
        waves = [rng.uniform(0.1, 0.4) * np.sin(rng.uniform(2.0, 9.0) * time + rng.uniform(0.0, 6.0)) for _ in range(2)]
        columns = {"position": rng.uniform(-0.3, 0.3) + sum(waves)}
    else:
        columns = {"effort": rng.uniform(-0.4, 0.4) + 0.3 * np.sin(rng.uniform(2.0, 9.0) * time)}
        conditions = {"position0": rng.uniform(-0.8, 0.8), "velocity0": rng.uniform(-2.0, 2.0)} | conditions
    return Trial(f"{rig}-{kind}", kind, columns, time, conditions)


def with_effect(rig, effect):
    """The rig's model with an effect at its default, where an effect of an angle meets the rig's range."""
    one = effect()
    if rig == "joint" and "angle_rad" in effect.parameters():
        one = effect(angle_rad=0.1)
    if effect.name == "electromechanical_delay":
        one = effect(delay_s=0.0117)  # a whole number of samples has a kink in every reading
    return Model(RIGS[rig]) + one


def everything(rig):
    """The rig's model with all effects at once."""
    model = Model(RIGS[rig])
    for effect in effects_for(rig):
        model = model + effect()
    return model


def jitter(rng, values, info):
    """Parameter values a little off, inside their bounds; discrete choices as they are."""
    out = {}
    for name, value in values.items():
        away = value + 0.2 * info[name].scale * rng.uniform(-1.0, 1.0) if info[name].fitted else value
        out[name] = min(max(away, info[name].lower), info[name].upper)
    return out


def forget_programs():
    """Drop the programs that are kept in memory, as if this process had just begun; those on disk stay."""
    program._PROGRAMS.clear()
    program._say_slow.cache_clear()


def foot(mass_kg, com_distance_m, inertia_kgm2):
    """The ankle's point foot with an inertia about the joint that is larger."""
    model = point_foot(mass_kg, com_distance_m)
    about_centre = (inertia_kgm2 - mass_kg * com_distance_m**2) * np.eye(3)
    model.inertias[1] = pin.Inertia(mass_kg, model.inertias[1].lever, about_centre)
    return model
