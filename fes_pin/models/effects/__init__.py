"""The catalogue: one file for each physical thing that a nominal model may leave out.

An effect is in the tests, the report, the documentation and the diagnosis by its line here.
"""

from __future__ import annotations

from fes_pin.models.effects.antagonist_spillover import AntagonistSpillover
from fes_pin.models.effects.base_tilt import BaseTilt
from fes_pin.models.effects.coulomb_friction import CoulombFriction
from fes_pin.models.effects.effort_offset import EffortOffset
from fes_pin.models.effects.electromechanical_delay import ElectromechanicalDelay
from fes_pin.models.effects.fatigue import Fatigue
from fes_pin.models.effects.force_length import ForceLength
from fes_pin.models.effects.force_velocity import ForceVelocity
from fes_pin.models.effects.frame_vibration import FrameVibration
from fes_pin.models.effects.joint_stop import JointStop
from fes_pin.models.effects.load_error import LoadError
from fes_pin.models.effects.load_inertia import LoadInertia
from fes_pin.models.effects.mains_hum import MainsHum
from fes_pin.models.effects.parallel_stiffness import ParallelStiffness
from fes_pin.models.effects.passive_relaxation import PassiveRelaxation
from fes_pin.models.effects.periodic_torque import PeriodicTorque
from fes_pin.models.effects.potentiation import Potentiation
from fes_pin.models.effects.quadratic_damping import QuadraticDamping
from fes_pin.models.effects.recruitment_curvature import RecruitmentCurvature
from fes_pin.models.effects.recruitment_hysteresis import RecruitmentHysteresis
from fes_pin.models.effects.rise_fall_asymmetry import RiseFallAsymmetry
from fes_pin.models.effects.second_order_activation import SecondOrderActivation
from fes_pin.models.effects.sensor_drift import SensorDrift
from fes_pin.models.effects.sensor_gain import SensorGain
from fes_pin.models.effects.sensor_lag import SensorLag
from fes_pin.models.effects.sensor_nonlinearity import SensorNonlinearity
from fes_pin.models.effects.sensor_offset import SensorOffset
from fes_pin.models.effects.stretch_reflex import StretchReflex
from fes_pin.models.effects.threshold_drift import ThresholdDrift
from fes_pin.models.effects.threshold_shift import ThresholdShift
from fes_pin.models.stage import Effect

EFFECTS: tuple[type[Effect], ...] = (
    AntagonistSpillover,
    RecruitmentCurvature,
    RecruitmentHysteresis,
    ThresholdDrift,
    ThresholdShift,
    ElectromechanicalDelay,
    Fatigue,
    ForceLength,
    ForceVelocity,
    Potentiation,
    RiseFallAsymmetry,
    SecondOrderActivation,
    CoulombFriction,
    EffortOffset,
    JointStop,
    LoadInertia,
    ParallelStiffness,
    PassiveRelaxation,
    QuadraticDamping,
    StretchReflex,
    BaseTilt,
    FrameVibration,
    LoadError,
    PeriodicTorque,
    MainsHum,
    SensorDrift,
    SensorGain,
    SensorLag,
    SensorNonlinearity,
    SensorOffset,
)
"""Every effect, in the order of the signal path."""


def effect(name: str) -> type[Effect]:
    """The effect of that name.

    Raises
    ------
    KeyError
        If the catalogue has none.
    """
    for one in EFFECTS:
        if one.name == name:
            return one
    raise KeyError(f"no effect {name!r}; there are {', '.join(e.name for e in EFFECTS)}")


def effects_for(rig: str) -> tuple[type[Effect], ...]:
    """The effects that a rig can have."""
    return tuple(e for e in EFFECTS if rig in e.rigs)
