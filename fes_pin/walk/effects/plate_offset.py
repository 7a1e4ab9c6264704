"""A force plate reads a constant off."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from fes_pin.body.joints import SIDES
from fes_pin.walk.effect import AXES, PLATES, Form, WalkEffect
from fes_pin.walk.walk_trial import ORDINARY_N, WalkTrial

ORDINARY_M = 0.004
"""Standard deviation of the centre of pressure of calibrated plates: its errors were 0.6 to 2.3 mm after and 2 to 14 mm
before calibration (A. Cappello et al., Gait Posture 33:724, 2011)."""


class PlateOffset(WalkEffect):
    """A force plate reads a constant off.

        read = true + constant                                 on always
        read = true + constant   while the foot is on it       on loaded
        centre of pressure = true + constant                   on pressure

    Tell-tale: steps in the residual when the foot comes and goes; with a displaced centre of pressure a moment as the
    load.
    Source: amplifier drift, a plate not zeroed; a plate's frame not where the cameras' frame has it.
    """

    name = "plate_offset"
    vector = "constant"

    @classmethod
    def forms(cls) -> Iterator[Form]:
        for site, sides in PLATES.items():
            single = float(len(sides) == 1)
            for axis, word in enumerate(AXES):
                for when, loaded in (("while loaded", True), ("always", False)):
                    columns = partial(_constant, sides=sides, axis=axis, loaded=loaded)
                    what, names = f"{site}, {word} force, {when}", (f"{word}_n",)
                    ordinary = single * ORDINARY_N * loaded
                    reads = () if loaded else tuple(3 * SIDES.index(s) + axis for s in sides)
                    yield Form(cls.name, what, names, 20.0, columns, ordinary=ordinary, reads=reads)
            for axis, word in enumerate(AXES[:2]):
                columns = partial(_displaced, sides=sides, axis=axis)
                what, names = f"{site}, centre of pressure {word}", (f"{word}_m",)
                yield Form(cls.name, what, names, 0.02, columns, ordinary=single * ORDINARY_M)


def _constant(trial: WalkTrial, sides: tuple[str, ...], axis: int, loaded: bool) -> np.ndarray:
    unit = {side: trial.force_at(trial.plates.pressure[side], np.eye(3)[axis]) for side in sides}
    read = [w * (trial.plates.loaded[s][:, None] if loaded else 1.0) for s, w in unit.items()]
    return np.sum(read, axis=0)[..., None]


def _displaced(trial: WalkTrial, sides: tuple[str, ...], axis: int) -> np.ndarray:
    force = np.sum([trial.plates.feet[side][:, :3] for side in sides], axis=0)
    return np.hstack([0.0 * force, np.cross(np.eye(3)[axis], force)])[:, :, None]
