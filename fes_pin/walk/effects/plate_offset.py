"""A force plate reads a constant off."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from fes_pin.body.joints import SIDES
from fes_pin.walk.effect import AXES, Form, WalkEffect
from fes_pin.walk.scene import Scene


class PlateOffset(WalkEffect):
    """A force plate reads a constant off: a force, a moment, or the place of its centre of pressure.

        read = true + constant, always or only while the foot is on it; or centre of pressure = true + constant

    Tell-tale: steps in the residual when the foot comes and goes; with a displaced centre of pressure a moment as the
    load.
    Source: amplifier drift, a plate not zeroed; a plate's frame not where the cameras' frame has it.
    """

    name = "plate_offset"

    @classmethod
    def forms(cls) -> Iterator[Form]:
        for site in ("both plates", *(f"{side} plate" for side in SIDES)):
            sides = SIDES if site == "both plates" else (site.split()[0],)
            for axis, word in enumerate(AXES):
                for when in ("while loaded", "always"):
                    columns = partial(_constant, sides=sides, axis=axis, loaded=when == "while loaded")
                    yield Form(cls.name, f"{site}, {word} force, {when}", (f"{word}_n",), ("N",), (20.0,), columns)
            for axis, word in enumerate(AXES[:2]):
                columns = partial(_displaced, sides=sides, axis=axis)
                yield Form(cls.name, f"{site}, centre of pressure {word}", (f"{word}_m",), ("m",), (0.02,), columns)


def _constant(scene: Scene, sides: tuple[str, ...], axis: int, loaded: bool) -> np.ndarray:
    total = np.zeros((len(scene.centre), 6, 1))
    for side in sides:
        share = scene.plates.loaded[side].astype(float) if loaded else np.ones(len(scene.centre))
        total[:, :, 0] += share[:, None] * scene.force_at(scene.plates.pressure[side], np.eye(3)[axis])
    return total


def _displaced(scene: Scene, sides: tuple[str, ...], axis: int) -> np.ndarray:
    total = np.zeros((len(scene.centre), 6, 1))
    for side in sides:
        total[:, 3:, 0] += np.cross(np.eye(3)[axis], scene.feet[side][:, :3])
    return total
