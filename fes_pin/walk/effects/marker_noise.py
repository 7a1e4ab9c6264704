"""Accelerations carry noise or filtering that the plates do not confirm."""

from collections.abc import Iterator

import numpy as np

from fes_pin.walk.effect import Form, WalkEffect
from fes_pin.walk.walk_trial import WalkTrial


class MarkerNoise(WalkEffect):
    """Accelerations carry noise or filtering that the plates do not confirm.

        required = true + smoothing d2 required / dt2   motion smoothed more than the plates       on smoothed
        coordinates = true + noise   white; its second derivative is in the required reaction        on white

    Tell-tale: too little of the reaction's fast part, or a residual that no two strides share and that grows with
    frequency.
    Source: a low pass of width s keeps 1 - (s w)^2 / 2 of a slow wave; noise of differentiated signals grows as w^4.
    """

    name = "marker_noise"

    @classmethod
    def forms(cls) -> Iterator[Form]:
        yield Form(cls.name, "smoothed", ("smoothing_s2",), 4e-4, _smoothed, positive=True)


def _smoothed(trial: WalkTrial) -> np.ndarray:
    return -np.gradient(np.gradient(trial.needed, trial.motion.dt, axis=0), trial.motion.dt, axis=0)[:, :, None]
