"""The rigs: nominal models of what a laboratory has on its table.

A rig is in the study format, the diagnosis, the report and the command line by its file in this folder.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pkgutil import iter_modules

from fes_pin.models.rigs.ankle import Ankle
from fes_pin.models.rigs.base import Rig
from fes_pin.models.rigs.joint import Joint
from fes_pin.models.rigs.muscle import Muscle, pulse_period

__all__ = ["RIGS", "Ankle", "Joint", "Muscle", "Rig", "pulse_period"]


def written_here() -> Iterator[type[Rig]]:
    """The rigs of this folder's files."""
    for file in iter_modules(__path__, f"{__name__}."):
        for one in vars(import_module(file.name)).values():
            if isinstance(one, type) and issubclass(one, Rig) and one.__module__ == file.name and hasattr(one, "name"):
                yield one


RIGS: tuple[type[Rig], ...] = tuple(sorted(written_here(), key=lambda rig: rig.name))
"""Every rig, by name."""
