"""Nerves as inputs of a linearized body: by name, with the strength of the body's size."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from fes_pin.body.build import Body
from fes_pin.body.controllability import ModalControllability
from fes_pin.body.controllability import modal_controllability as _controllability
from fes_pin.body.joints import JOINT_NAMES, SIDES
from fes_pin.body.linearize import LinearBody
from fes_pin.muscles.nerves import SUBJECT_HEIGHT, Nerves, nerve_names


def subject_nerves(body: Body, names: Iterable[str] | None = None, strength: float | None = None, **options) -> Nerves:
    """The nerves of a body of this size: strength as mass, moment arms as height (1.80 m where it is not known).

    Parameters
    ----------
    body
        Whose nerves.
    names
        `left_femoral`; `femoral` stands for both sides. None: all nerves of the table.
    strength
        Of a healthy adult's of that size; not given: that of paralysed, stimulated muscle, as everywhere.
    options
        Further ones of `Nerves` (`fatigue`, `force_length`).

    Raises
    ------
    InputError
        No nerve, or an unknown one.
    """
    known = Nerves().names
    wanted: list[str] = []
    for name in known if names is None else nerve_names(names):
        both = [f"{side}_{name}" for side in SIDES]
        wanted += both if set(known).issuperset(both) else [name]
    height = body.height_m or SUBJECT_HEIGHT
    return Nerves.of_subject(body.mass_kg, height, tuple(dict.fromkeys(wanted)), strength, **options)


def controllability(linear: LinearBody, inputs, horizon: float = 0.3) -> ModalControllability:
    """`fes_pin.body.controllability.modal_controllability`, which also understands names of nerves.

    Parameters
    ----------
    linear
        From `linearize`.
    inputs
        Names of nerves (`left_femoral`, or `femoral` for both sides), of joints with a motor, `Nerves` or `Inputs`.
        Several names may come in any collection.
    horizon
        Time allowed to bring a mode back, s.

    Raises
    ------
    InputError
        No name, or that of no nerve and no joint.
    """
    if isinstance(inputs, Iterable) and not isinstance(inputs, Mapping):
        inputs = nerve_names(inputs)
        if not set(inputs) <= set(JOINT_NAMES):
            inputs = subject_nerves(linear.body, inputs)
    return _controllability(linear, inputs, horizon)
