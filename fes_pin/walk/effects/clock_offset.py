"""Force plates and motion capture are not in time with each other."""

from collections.abc import Iterator

import numpy as np

from fes_pin.walk.effect import Form, WalkEffect
from fes_pin.walk.motion import about
from fes_pin.walk.walk_trial import WalkTrial


class ClockOffset(WalkEffect):
    """Force plates and motion capture are not in time with each other.

        measured(t) = true(t - late); positive: the plates are late

    Tell-tale: the residual is the rate of the reaction, greatest where a foot comes and goes.
    Source: two recorders, one trigger; a camera's exposure, an amplifier's filter.
    """

    name = "clock_offset"

    @classmethod
    def forms(cls) -> Iterator[Form]:
        yield Form(cls.name, "both plates", ("late_s",), 0.03, _rate, shifts=True)


def _rate(trial: WalkTrial) -> np.ndarray:
    """Return how fast the plates' reading changes, about the centre of mass where it is."""
    way = trial.plates.way
    rate = np.gradient(about(trial.plates.total, way), trial.motion.dt, axis=0)
    return -about(rate, trial.motion.centre - way)[:, :, None]
