"""Conventions of a recorded walk, tested: units and signs of its coordinates and plates, and whose plate is which.

The test is that a foot which stands has its centre of pressure below its sole, and moves with the ground alone. What is
stated is kept; else a file is taken as the study format has it, unless another convention is unmistakable, which is
said.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from fes_pin.data.errors import KeyFault
from fes_pin.data.schema import check_known, one_of
from fes_pin.data.walk_forces import FORCES, MOMENTS, MOMENTS_ON, ON, moments, sign_and_unit_of_forces, signs_of_shears
from fes_pin.data.walk_level import AXES, axes_of
from fes_pin.data.walk_motion import (
    ANKLES,
    KNEES,
    LENGTHS,
    signs_of_ankles,
    signs_of_knees,
    unit_of_pressure,
    units_of_motion,
)
from fes_pin.data.walk_plates import PLATES, whose_plates
from fes_pin.data.walk_recorded import SIDES, Arrays, RecordedWalk

WORDS: Mapping[str, Sequence[str]] = {
    **{f"knee_flexion_{side}": tuple(KNEES) for side in SIDES.values()},
    **{f"dorsiflexion_{side}": tuple(ANKLES) for side in SIDES.values()},
    "angle_unit": ("rad", "deg"),
    "translation_unit": tuple(LENGTHS),
    "pressure_unit": tuple(LENGTHS),
    "force_unit": tuple(FORCES),
    "moment_unit": tuple(MOMENTS),
    **{f"{what}_on": tuple(ON) for what in ("fx", "fy", "fz", "moments")},
    "moments_about": ("pressure", "origin"),
    "axes": AXES,
}
"""Keys of `[conventions]` and what each may be; the first is how the study format has it."""
STANDARD = {key: words[0] for key, words in WORDS.items() if key != MOMENTS_ON} | {PLATES[0]: ["r"], PLATES[1]: ["l"]}
"""Conventions of files that the package writes."""


def checked_conventions(table: Mapping[str, Any], error: KeyFault) -> dict[str, Any]:
    """What a table `[conventions]` states, by key.

    Raises
    ------
    InputError
        Made by `error`, for an unknown key or word, or plates that are no list of labels.
    """
    check_known(table, (*WORDS, *PLATES), error)
    out: dict[str, Any] = {}
    for key, value in table.items():
        if key in WORDS:
            out[key] = one_of(value, tuple(WORDS[key]), partial(error, key))
        elif isinstance(value, list) and all(isinstance(v, str | int) and len(str(v)) == 1 for v in value):
            out[key] = [str(v) for v in value]
        else:
            raise error(key, "expected a list of plates: their numbers, r or l")
    return out


def conventional(
    time: np.ndarray,
    coordinates: Mapping[str, np.ndarray],
    in_degrees: bool,
    push_time: np.ndarray,
    plates: Mapping[str, Mapping[str, np.ndarray]],
    stated: Mapping[str, Any] | None = None,
    mass_kg: float | None = None,
) -> tuple[Arrays, Arrays, tuple[str, ...]]:
    """A walk as the study format has it, whatever conventions its files follow.

    Parameters
    ----------
    time, coordinates
        (n,) s; `q_<coordinate>` and rates, (n,), as the file has them.
    in_degrees
        What the file says of its angles.
    push_time, plates
        (m,) s; by plate `Fx` ... `copx` ... `Tz`, (m,): see `fes_pin.data.motion.plates_in`.
    stated
        Conventions that the study states; see `checked_conventions`.
    mass_kg
        Of the body, if it is known.

    Returns
    -------
    coordinates
        rad and m, knees with flexion negative, ankles with dorsiflexion positive, angles without jumps.
    reaction
        `r_` and `l_` `Fx` ... `Tz`: N, m, N m about the centre of pressure, on the foot.
    said
        What was taken otherwise than the format has it, a sentence each.

    Raises
    ------
    InputError
        Plates are numbered, and whose foot stands on one is not shown.
    """
    walk = RecordedWalk(time, dict(coordinates), push_time, {k: dict(v) for k, v in plates.items()}, dict(stated or {}))
    with np.errstate(all="ignore"):  # numbers that nobody measured may overflow; no test is passed by them
        sign_and_unit_of_forces(walk, mass_kg)
        units_of_motion(walk, in_degrees)
        unit_of_pressure(walk)
        whose_plates(walk)
        signs_of_knees(walk)
        signs_of_ankles(walk)
        signs_of_shears(walk)
        moments(walk)
        axes_of(walk, mass_kg)
    return walk.moves, {f"{s}_{kind}": v for s in SIDES for kind, v in walk.plates[s].items()}, tuple(walk.said)
