"""Something pushes or holds the body that no plate measures."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from fes_pin.walk.effect import AXES, Form, WalkEffect
from fes_pin.walk.walk_trial import WalkTrial

PLACES = {
    "pelvis": ("pelvis", (0.0, 0.0, 0.0)),
    "trunk": ("trunk", (0.0, 0.0, 0.30)),
    "left hand": ("trunk", (0.25, 0.35, 0.10)),
    "right hand": ("trunk", (0.25, -0.35, 0.10)),
}
"""Segment and place in it, m from the centre between the hips or from the lumbar joint: belt, harness, hand rails
next to the hips (round figures for an adult)."""


class ExternalForce(WalkEffect):
    """A hand rail, harness or push carries load that no plate measures.

        measured = required - F, at a place that moves with pelvis or trunk; F constant

    Tell-tale: plates show too little weight, or a horizontal force whose mean is not zero although the speed is steady.
    Source: equilibrium of the whole body; a steady walk's mean acceleration is zero.
    """

    name = "external_force"
    vector = "F"

    @classmethod
    def forms(cls) -> Iterator[Form]:
        for place in PLACES:
            for axes in ((0,), (1,), (2,), (0, 2)):
                names = tuple(f"{AXES[a]}_n" for a in axes)
                words = " and ".join(AXES[a] for a in axes)
                columns = partial(_pushed, place=place, axes=axes)
                yield Form(cls.name, f"{place}, {words}", names, 50.0, columns)


def place_of(trial: WalkTrial, place: str) -> np.ndarray:
    """Where a force acts that is named by a place of `PLACES`: (n, 3) m."""
    segment, offset = PLACES[place]
    turn, origin = trial.motion.poses[segment]
    if segment == "pelvis":  # links begin at the joint towards the ground: the pelvis's at the stance hip
        other = "left" if trial.motion.body.stance == "right" else "right"
        origin = 0.5 * (origin + trial.motion.poses[f"{other}_thigh"][1])
    return origin + turn @ np.array(offset)


def _pushed(trial: WalkTrial, place: str, axes: tuple[int, ...]) -> np.ndarray:
    point = place_of(trial, place)
    return np.stack([-trial.force_at(point, np.eye(3)[a]) for a in axes], axis=2)
