"""Nerves as inputs of a linearized body: by name, with the strength of the body's size, sex and years, as measured."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from fes_pin.body.build import Body
from fes_pin.body.controllability import ModalControllability, modal_controllability
from fes_pin.body.inputs import Inputs
from fes_pin.body.joints import JOINT_NAMES, SIDES
from fes_pin.body.linearize import LinearBody
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import instance, known_word
from fes_pin.muscles.nerves import SUBJECT_HEIGHT, Nerves, nerve_names
from fes_pin.muscles.paths import read_table

_MEASURED = (row.values() for row in read_table("peaks.csv"))
PEAKS_2007 = {(who, years): tuple(map(float, peaks)) for who, years, *peaks in _MEASURED}
"""Peak torques, per body weight times height, of hip extension and flexion, knee extension and flexion, plantarflexion
and dorsiflexion, by sex and years: D. E. Anderson, M. L. Madigan, M. A. Nussbaum, J. Biomech. 40:3105-3113, 2007, table
3 (as the muscle add-on of RBDL has it; the article was not at hand)."""


YEARS = ("18 to 25", "55 to 65", "over 65")
"""Groups of years whose strength has been measured (`PEAKS_2007`)."""


def _who(body: Body) -> str:
    return "woman" if body.sex == "female" else "man"


def whose_strength(body: Body, years: str = YEARS[0]) -> str:
    """Whose strength 1 is with `subject_nerves`, as in "a healthy woman of 18 to 25 years, 60 kg and 1.65 m"."""
    height = f"{body.height_m or SUBJECT_HEIGHT:.2f} m" + ("" if body.height_m else " (assumed)")
    return f"a healthy {_who(body)} {'of ' * years[0].isdigit()}{years} years, {body.mass_kg:.0f} kg and {height}"


def subject_nerves(
    body: Body, names: Iterable[str] | None = None, strength: float | None = None, *, years: str = YEARS[0], **options
) -> Nerves:
    """The nerves of a body of this size, sex and years.

    Strength goes as mass and moment arms as height (1.80 m where it is not known), so that torques go as the product,
    as leg muscles' volumes do (G. G. Handsfield et al., J. Biomech. 47:631-638, 2014). That is a young man's. Others'
    is his times a mean over six joint torques per weight and height (Anderson, Madigan and Nussbaum 2007, table 3):
    young women 1.01, men of 55 to 65 years 0.99 and over 65 0.90, women 0.81 and 0.83. Single joints differ from such
    a mean: a young woman's dorsiflexion is 0.82 of a man's, her hip's torques 1.12. A body whose sex is not known
    counts as a man's.

    Parameters
    ----------
    body
        Whose nerves.
    names
        `left_femoral`; `femoral` means both sides. All nerves of the table by default.
    strength
        1 is the strength of `whose_strength`; not given: that of paralysed, stimulated muscle, as everywhere.
    years
        One of `YEARS`.
    options
        Further ones of `Nerves` (`fatigue`, `force_length`).

    Raises
    ------
    InputError
        Unknown nerve, none of them, or other years.
    """
    known_word(years, YEARS, "years")
    known = Nerves().names
    wanted: list[str] = []
    for name in known if names is None else nerve_names(names):
        both = [f"{side}_{name}" for side in SIDES]
        wanted += both if set(known).issuperset(both) else [name]
    height = instance(body, Body, "body").height_m or SUBJECT_HEIGHT
    nerves = Nerves.of_subject(body.mass_kg, height, tuple(dict.fromkeys(wanted)), strength, **options)
    own, of_young_men = np.array(PEAKS_2007[_who(body), years]), np.array(PEAKS_2007["man", YEARS[0]])
    return replace(nerves, size=nerves.size * float(np.mean(own / of_young_men)))  # mean of six actions


def controllability(linear: LinearBody, inputs, horizon: float = 0.3) -> ModalControllability:
    """Controllability of every mode of a body by nerves, joints with a motor, or other inputs.

    Parameters
    ----------
    linear
        From `linearize`.
    inputs
        Names of nerves (`left_femoral`, or `femoral` for both sides), of joints with a motor, `Nerves` or `Inputs`.
        A set of names is taken in alphabetical order.
    horizon
        Time allowed to bring a mode back, s.

    Raises
    ------
    InputError
        Unknown nerve or joint.
    """
    return modal_controllability(linear, inputs_by_name(linear, inputs), horizon)


def inputs_by_name(linear: LinearBody, inputs) -> Inputs:
    """Inputs of whatever names them: nerves or joints, in a list, a tuple, a set or a generator; `Nerves`; `Inputs`.

    Raises
    ------
    InputError
        Unknown nerve or joint, or none.
    """
    if isinstance(inputs, Inputs) or hasattr(inputs, "torque_matrix"):
        return Inputs.of(inputs, linear)
    if not isinstance(inputs, Iterable) or hasattr(inputs, "keys"):
        raise InputError("inputs must be Inputs, Nerves, or names of nerves or joints")
    Inputs.of((), linear)  # a body, not something else
    names = nerve_names(inputs)
    return Inputs.of(names if set(names) <= set(JOINT_NAMES) else subject_nerves(linear.body, names), linear)
