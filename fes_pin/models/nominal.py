"""The model that a study believes: its rig with the start values."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fes_pin.data.errors import InputError
from fes_pin.data.study import Study
from fes_pin.models.model import Model
from fes_pin.models.rigs import Ankle, Joint, Muscle, pulse_period
from fes_pin.models.rigs.rigid import gravity_coefficients, is_revolute, joint_inertia, load_urdf


def nominal_model(study: Study) -> Model:
    """The nominal model of a study, with its start values.

    Raises
    ------
    InputError
        If the rig has no model of trials.
    """
    constants: dict[str, Any] = dict(study.constants)
    start: dict[str, Any] = dict(study.start)
    if study.rig == "ankle":
        return Model(Ankle(constants=constants, **start))
    if study.rig == "muscle":
        pulsed = [t for t in study.trials if "stim" in t.columns]
        known = {**constants, "pulse_period_s": pulse_period(pulsed)} if pulsed else constants
        return Model(Muscle(constants=known, **start))
    if study.rig == "joint":
        assert study.urdf is not None
        driven = any("effort" in t.columns for t in study.trials)
        return Model(joint_model(study.urdf, constants, start, driven))
    raise InputError(f"the rig {study.rig} has no model of single trials", file=study.folder)


def joint_model(urdf: Path, constants: Mapping[str, Any], start: Mapping[str, Any], driven: bool = True) -> Joint:
    """A one-joint rig from its URDF.

    Parameters
    ----------
    constants
        Parameters of the nominal model that are known.
    start
        Those that are fitted, with their start values.
    driven
        False for free motion, without an effort.

    Raises
    ------
    InputError
        If Pinocchio cannot read the URDF.
    """
    body = load_urdf(urdf)
    cosine, sine = gravity_coefficients(body)
    known = {n: constants[n] for n in Joint.parameters() if n in constants}
    read = {"inertia": joint_inertia(body), "gravity_cos": cosine, "gravity_sin": sine}
    read["revolute"] = float(is_revolute(body))
    fitted = tuple(n for n in Joint.parameters() if n in start)
    if not driven and "gravity_scale" in fitted:  # free motion shows only ratios: the URDF's inertia holds
        fitted = tuple(n for n in fitted if n != "inertia_scale")
    return Joint(constants=read, fitted=fitted, **{**known, **start})
