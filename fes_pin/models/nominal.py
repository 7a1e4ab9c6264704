"""The model that a study believes: its rig with the start values."""

from __future__ import annotations

from fes_pin.data.errors import InputError
from fes_pin.data.study import Study
from fes_pin.models.model import Model
from fes_pin.models.rigs.base import Rig


def nominal_model(study: Study) -> Model:
    """The nominal model of a study, with its start values.

    Raises
    ------
    InputError
        If the rig has no model of trials.
    """
    return Model(rig_of(study).of_study(study))


def rig_of(study: Study) -> type[Rig]:
    """The rig that a study is of.

    Raises
    ------
    InputError
        If it has no model of trials.
    """
    rig = study.schema.owner
    if rig is None:
        raise InputError(f"the rig {study.rig} has no model of single trials", file=study.folder)
    return rig
