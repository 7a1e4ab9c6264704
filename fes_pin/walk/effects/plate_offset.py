"""A force plate reads a constant off."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from scipy.ndimage import binary_dilation

from fes_pin.walk.effect import AXES, PLATES, Form, WalkEffect
from fes_pin.walk.walk_trial import WalkTrial

ORDINARY_N, ORDINARY_M = 1.5, 0.004
"""Standard deviations of calibrated plates while loaded: mean errors of force were 2.5 to 5 N, of the centre of
pressure 0.6 to 2.3 mm after and 2 to 14 mm before calibration (A. Cappello et al., Gait Posture 33:724, 2011)."""

SETTLED_S = 0.1
"""s; how far from a step the low pass no longer carries it."""


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
        for site, sides in PLATES.items():
            single = float(len(sides) == 1)
            for axis, word in enumerate(AXES):
                for when in ("while loaded", "always"):
                    columns = partial(_constant, sides=sides, axis=axis, loaded=when == "while loaded")
                    yield Form(
                        cls.name, f"{site}, {word} force, {when}", (f"{word}_n",), 20.0, columns,
                        ordinary=single * ORDINARY_N * (when == "while loaded"),
                        reading=partial(_unloaded, sides=sides, axis=axis) if when == "always" else None,
                    )  # fmt: skip
            for axis, word in enumerate(AXES[:2]):
                columns = partial(_displaced, sides=sides, axis=axis)
                yield Form(
                    cls.name, f"{site}, centre of pressure {word}", (f"{word}_m",), 0.02, columns,
                    ordinary=single * ORDINARY_M,
                )  # fmt: skip


def _constant(trial: WalkTrial, sides: tuple[str, ...], axis: int, loaded: bool) -> np.ndarray:
    unit = {side: trial.force_at(trial.plates.pressure[side], np.eye(3)[axis]) for side in sides}
    return np.sum([w * (trial.plates.loaded[s][:, None] if loaded else 1.0) for s, w in unit.items()], axis=0)[
        ..., None
    ]


def _unloaded(trial: WalkTrial, sides: tuple[str, ...], axis: int) -> tuple[np.ndarray, float] | None:
    """What the plates read while nobody stands on them, which is what they always read: the least of both."""
    values = []
    for side in sides:
        free = ~binary_dilation(trial.plates.loaded[side], iterations=int(np.ceil(SETTLED_S / trial.motion.dt)))
        if not free.any():
            return None
        values.append(float(np.mean(trial.plates.feet[side][free, axis])))
    return np.array([min(values, key=abs)]), ORDINARY_N


def _displaced(trial: WalkTrial, sides: tuple[str, ...], axis: int) -> np.ndarray:
    force = np.sum([trial.plates.feet[side][:, :3] for side in sides], axis=0)
    return np.hstack([0.0 * force, np.cross(np.eye(3)[axis], force)])[:, :, None]
