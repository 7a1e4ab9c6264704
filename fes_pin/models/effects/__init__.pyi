"""The effects by the names of their classes; written by `scripts/generate/effect_types.py`."""

from fes_pin.models.effects.antagonist_spillover import AntagonistSpillover as AntagonistSpillover
from fes_pin.models.effects.backlash import Backlash as Backlash
from fes_pin.models.effects.base_tilt import BaseTilt as BaseTilt
from fes_pin.models.effects.cogging import Cogging as Cogging
from fes_pin.models.effects.coulomb_friction import CoulombFriction as CoulombFriction
from fes_pin.models.effects.effort_gain import EffortGain as EffortGain
from fes_pin.models.effects.effort_offset import EffortOffset as EffortOffset
from fes_pin.models.effects.electromechanical_delay import ElectromechanicalDelay as ElectromechanicalDelay
from fes_pin.models.effects.fatigue import Fatigue as Fatigue
from fes_pin.models.effects.force_length import ForceLength as ForceLength
from fes_pin.models.effects.force_velocity import ForceVelocity as ForceVelocity
from fes_pin.models.effects.frame_vibration import FrameVibration as FrameVibration
from fes_pin.models.effects.joint_stop import JointStop as JointStop
from fes_pin.models.effects.length_dependent_activation import LengthDependentActivation as LengthDependentActivation
from fes_pin.models.effects.load_error import LoadError as LoadError
from fes_pin.models.effects.load_inertia import LoadInertia as LoadInertia
from fes_pin.models.effects.mains_hum import MainsHum as MainsHum
from fes_pin.models.effects.parallel_stiffness import ParallelStiffness as ParallelStiffness
from fes_pin.models.effects.passive_relaxation import PassiveRelaxation as PassiveRelaxation
from fes_pin.models.effects.periodic_torque import PeriodicTorque as PeriodicTorque
from fes_pin.models.effects.potentiation import Potentiation as Potentiation
from fes_pin.models.effects.pulse_summation import PulseSummation as PulseSummation
from fes_pin.models.effects.quadratic_damping import QuadraticDamping as QuadraticDamping
from fes_pin.models.effects.recruitment_curvature import RecruitmentCurvature as RecruitmentCurvature
from fes_pin.models.effects.recruitment_hysteresis import RecruitmentHysteresis as RecruitmentHysteresis
from fes_pin.models.effects.residual_force_enhancement import ResidualForceEnhancement as ResidualForceEnhancement
from fes_pin.models.effects.rise_fall_asymmetry import RiseFallAsymmetry as RiseFallAsymmetry
from fes_pin.models.effects.second_order_activation import SecondOrderActivation as SecondOrderActivation
from fes_pin.models.effects.sensor_drift import SensorDrift as SensorDrift
from fes_pin.models.effects.sensor_gain import SensorGain as SensorGain
from fes_pin.models.effects.sensor_lag import SensorLag as SensorLag
from fes_pin.models.effects.sensor_nonlinearity import SensorNonlinearity as SensorNonlinearity
from fes_pin.models.effects.sensor_offset import SensorOffset as SensorOffset
from fes_pin.models.effects.series_elasticity import SeriesElasticity as SeriesElasticity
from fes_pin.models.effects.stretch_reflex import StretchReflex as StretchReflex
from fes_pin.models.effects.threshold_drift import ThresholdDrift as ThresholdDrift
from fes_pin.models.effects.threshold_shift import ThresholdShift as ThresholdShift
from fes_pin.models.stage import Effect

EFFECTS: tuple[type[Effect], ...]

def effect_named(name: str) -> type[Effect]: ...
def effects_for(rig: str) -> tuple[type[Effect], ...]: ...
