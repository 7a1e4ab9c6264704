"""A force plate reads off by a factor."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from fes_pin.walk.effect import PLATES, Form, WalkEffect
from fes_pin.walk.walk_trial import WalkTrial


class PlateGain(WalkEffect):
    """A force plate reads off by a factor.

        read = (1 + share) true

    in all of its channels, or in one axis of the force.

    Tell-tale: the residual is a copy of one foot's reaction; weight is off while that foot stands.
    Source: amplifier gain, calibration matrix.
    """

    name = "plate_gain"

    @classmethod
    def forms(cls) -> Iterator[Form]:
        for site, sides in PLATES.items():
            for axes, word in ((AXES, ""), ((2,), ", vertical"), ((0,), ", forward"), ((1,), ", sideways")):
                columns = partial(_scaled, sides=sides, axes=axes)
                yield Form(cls.name, f"{site}{word}", ("share",), 0.1, columns)


AXES = (0, 1, 2)
"""Forward, left and vertical."""


def _scaled(trial: WalkTrial, sides: tuple[str, ...], axes: tuple[int, ...]) -> np.ndarray:
    return np.sum([_part(trial, side, axes) for side in sides], axis=0)[:, :, None]


def _part(trial: WalkTrial, side: str, axes: tuple[int, ...]) -> np.ndarray:
    if axes == AXES:
        return trial.true_feet[side]
    force = trial.true_feet[side][:, :3] * np.isin(AXES, axes)
    return trial.force_at(trial.plates.pressure[side], force)
