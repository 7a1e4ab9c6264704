"""Nerves as inputs of a linearized body: by name, with the strength of the body's size."""

from __future__ import annotations

from collections.abc import Iterable

from fes_pin.body.build import Body
from fes_pin.body.controllability import ModalControllability
from fes_pin.body.controllability import modal_controllability as _controllability
from fes_pin.body.joints import JOINT_NAMES, SIDES
from fes_pin.body.linearize import LinearBody
from fes_pin.muscles.nerves import SUBJECT_HEIGHT, Nerves


def subject_nerves(body: Body, names: Iterable[str] = (), strength: float | None = None, **options) -> Nerves:
    """The nerves of a body of this size: strength as mass, moment arms as height (1.80 m where it is not known).

    Parameters
    ----------
    body
        Whose nerves.
    names
        `left_femoral`; `femoral` stands for both sides. All nerves of the table by default.
    strength
        Of a healthy adult's of that size; not given: that of paralysed, stimulated muscle, as everywhere.
    options
        Further ones of `Nerves` (`fatigue`, `force_length`).

    Raises
    ------
    InputError
        Unknown nerve.
    """
    known = set(Nerves().names)
    wanted: list[str] = []
    for name in [names] if isinstance(names, str) else names:
        both = [f"{side}_{name}" for side in SIDES]
        wanted += both if known.issuperset(both) else [name]
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
    horizon
        Time allowed to bring a mode back, s.

    Raises
    ------
    InputError
        Unknown nerve or joint.
    """
    names = [inputs] if isinstance(inputs, str) else inputs
    if isinstance(names, list | tuple) and names and not set(names) <= set(JOINT_NAMES):
        inputs = subject_nerves(linear.body, names)
    return _controllability(linear, inputs, horizon)
