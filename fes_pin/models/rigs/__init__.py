"""The rigs: nominal models of what a laboratory has on its table."""

from fes_pin.models.rigs.ankle import Ankle
from fes_pin.models.rigs.base import Rig
from fes_pin.models.rigs.joint import Joint
from fes_pin.models.rigs.muscle import Muscle, pulse_period

RIGS: tuple[type[Rig], ...] = (Ankle, Joint, Muscle)

__all__ = ["RIGS", "Ankle", "Joint", "Muscle", "Rig", "pulse_period"]
