"""The ground slopes: gravity acts at another angle than believed."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from fes_pin.body.build import GRAVITY
from fes_pin.walk.effect import AXES, Form, WalkEffect
from fes_pin.walk.walk_trial import WalkTrial

ORDINARY_RAD = 0.004
"""Standard deviation where nothing is wrong: frames of cameras and plates are level to a quarter of a degree each way,
about what a spirit level and a calibration frame tell (a round figure)."""


class LaboratoryTilt(WalkEffect):
    """The treadmill or the laboratory's frame slopes: gravity acts at another angle than believed.

        g -> g + g0 tilt, along the frame's level axes; positive: downhill that way

    Tell-tale: a horizontal force of constant size, tilt times weight, at the centre of mass.
    Source: gravity in a frame that is not level.
    """

    name = "base_tilt"
    vector = "tilt"

    @classmethod
    def forms(cls) -> Iterator[Form]:
        for axes in ((0,), (1,), (0, 1)):
            words, columns = [AXES[a] for a in axes], partial(_tilted, axes=axes)
            names = tuple(f"{w}_rad" for w in words)
            ordinary = ORDINARY_RAD * (len(words) == 1)
            yield Form(cls.name, " and ".join(words), names, 0.05, columns, ordinary=ordinary)


def _tilted(trial: WalkTrial, axes: tuple[int, ...]) -> np.ndarray:
    mass = sum(p[0] for p in trial.motion.parameters.values())
    out = np.zeros((len(trial.needed), 6, len(axes)))
    out[:, axes, range(len(axes))] = -mass * GRAVITY
    return out
