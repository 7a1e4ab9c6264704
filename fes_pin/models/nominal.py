"""The nominal model of a study: its rig with the start values."""

import math
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from fes_pin.data.errors import InputError, fault_at
from fes_pin.data.numbers import instance
from fes_pin.data.schema import check_known
from fes_pin.data.study import Study
from fes_pin.data.urdf import stated_of_joint
from fes_pin.models.model import Model
from fes_pin.models.rigs.base import Rig
from fes_pin.models.rigs.joint import WEIGHTLESS
from fes_pin.models.rigs.rigid import gravity_coefficients, joint_inertia, joint_is_revolute, load_urdf
from fes_pin.models.session import session_of

RUN_OUT_S = 10.0
"""Typical time constant in s of a laboratory's joint, inertia over damping: a start value."""


def nominal_model(study: Study) -> Model:
    """Return the nominal model of a study, with its start values.

    Raises
    ------
    InputError
        If the rig has no model of trials, no parameter of a name in `start`, or lacks its URDF; a value that cannot be.
    """
    kind = rig_of(study)
    check_known(study.start, kind.parameters(), fault_at("start.{}", study.folder))
    rig = kind.of_study(study)
    recruited = {t: known for t in study.trials if (known := rig.recruited(t)) is not None}
    return Model(replace(rig, session=session_of(list(recruited), recruited.__getitem__)))


def rig_of(study: Study) -> type[Rig]:
    """Return the rig of a study.

    Raises
    ------
    InputError
        If it has no model of trials.
    """
    rig = instance(study, Study, "study").schema.owner
    if rig is None:
        raise InputError(f"the rig {study.rig} has no model of single trials", file=study.folder)
    return rig


def _swings(body: Any) -> bool:
    """Return whether a joint turns, and feels gravity."""
    return joint_is_revolute(body) and math.hypot(*gravity_coefficients(body)) > WEIGHTLESS * joint_inertia(body)


def guess_start(
    rig: type[Rig], known: Mapping[str, float], urdf: Path | None = None, columns: Collection[str] = ()
) -> dict[str, float]:
    """Return start values of a rig's fitted parameters where none are given: only their size matters.

    The weight of a joint that turns is fitted where its effort was recorded, as its inertia is: both are those of the
    URDF. That of a slide is a constant, which its effort may have as an offset. Damping that the URDF states above 0 is
    its start value.

    Parameters
    ----------
    known
        Given numbers of the rig.
    urdf
        The URDF of a joint.
    columns
        What was recorded.

    Raises
    ------
    InputError
        If the URDF cannot be read.
    """
    needed = {name for name, number in rig.schema.start.items() if number.required}
    out = {name: float(getattr(rig, name)) for name in rig.parameters() if name in needed}
    if urdf is not None and out.get("damping") == 0.0:
        body = load_urdf(urdf)
        out["damping"] = stated_of_joint(urdf).get("damping") or joint_inertia(body) / RUN_OUT_S
        if "effort" in columns and _swings(body):
            out["gravity_scale"] = 1.0
    if {"foot_mass_kg", "com_distance_m"} <= set(known) and "inertia_kgm2" in out:
        out["inertia_kgm2"] = known["foot_mass_kg"] * known["com_distance_m"] ** 2
    return out
