"""The rigs: nominal models of what a laboratory has on its table.

A rig is in the study format, the diagnosis, the report and the command line by its file in this folder.
"""

from fes_pin.models.rigs.ankle import Ankle
from fes_pin.models.rigs.base import Rig
from fes_pin.models.rigs.joint import Joint
from fes_pin.models.rigs.muscle import Muscle, pulse_period
from fes_pin.models.stage import classes_in

__all__ = ["RIGS", "Ankle", "Joint", "Muscle", "Rig", "pulse_period"]


RIGS = tuple(sorted((one for one in classes_in(__path__, __name__, Rig) if hasattr(one, "name")), key=lambda r: r.name))
"""The rigs of this folder's files, by name."""
