"""Changes of the residual by errors in the coordinates: soft tissue, white noise, misplaced landmarks."""

from collections.abc import Callable

import numpy as np

from fes_pin.data.motion import TRANSLATIONS
from fes_pin.walk.motion import about
from fes_pin.walk.strides import Strides
from fes_pin.walk.walk_trial import WalkTrial

TISSUE_DRAWS, WHITE_DRAWS = 40, 64
"""Numbers of simulated errors."""
PAD_S = 0.3
"""Time before and after a stride, so that the filter's ends do not matter."""
TISSUE_M, TISSUE_RAD = 0.002, 0.01
"""Soft tissue's share of a coordinate's wave once a stride; it falls as 1 / h (Leardini et al., Gait Posture 21, 2005:
some 10 mm on the thigh, a few degrees in its angles). Only proportions matter."""
TISSUE_WAVES = 8
"""Number of waves of soft tissue: a walk's low pass removes higher ones."""
CLUSTER_M = 0.15
"""Half the length of a cluster of markers, m: noise of markers, in m, over this is noise of angles, in rad."""

LANDMARK_M, LANDMARK_RAD = 0.005, 0.026
"""Ordinary errors of where a coordinate's zero is, as standard deviations: landmarks are found to 6 to 21 mm, and a
segment's frame is the mean of several (U. Della Croce et al., Gait Posture 21:226, 2005)."""

Disturbance = Callable[[np.ndarray, np.ndarray, np.random.Generator], np.ndarray]
"""Function of the phase in the stride, (n,), of whether each coordinate is an angle, (c,), and of a generator: errors
of the coordinates, (draws, c, n)."""


def tissue(phase: np.ndarray, angle: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return errors that repeat in each stride."""
    h = np.arange(1, TISSUE_WAVES + 1)
    sizes = random.normal(size=(TISSUE_DRAWS, len(angle), TISSUE_WAVES, 2)) / h[:, None]
    turn = 2.0 * np.pi * np.outer(h, phase)
    waves = sizes[..., 0] @ np.cos(turn) + sizes[..., 1] @ np.sin(turn)
    return np.where(angle, TISSUE_RAD, TISSUE_M)[:, None] * waves


def white(phase: np.ndarray, angle: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return white noise as of markers with 1 mm."""
    noise = random.normal(size=(WHITE_DRAWS, len(angle), len(phase)))
    return 1e-3 * noise / np.where(angle, CLUSTER_M, 1.0)[:, None]


def misplaced(phase: np.ndarray, angle: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the ordinary error of each coordinate's zero, one coordinate after the other."""
    return np.diag(np.where(angle, LANDMARK_RAD, LANDMARK_M))[:, :, None] * np.ones_like(phase)


def disturbed(trial: WalkTrial, strides: Strides, kind: Disturbance, seed: int) -> np.ndarray:
    """Return changes of the residual's waves in the first stride by errors of the coordinates: (draws, 6, k)."""
    _, rows, phase = strides.windows[0]
    time = trial.motion.time[rows]
    near = (trial.time >= time[0] - PAD_S) & (trial.time <= time[-1] + PAD_S)
    clock = trial.time[near]
    columns = {n: c[near] for n, c in trial.coordinates.items() if n.startswith("q_")}
    turn = (clock - time[0]) / ((time[-1] - time[0]) * len(time) / (len(time) - 1)) + phase[0]
    inside = (clock >= time[0] - 1e-9) & (clock <= time[-1] + 1e-9)
    total = trial.plates.total[rows]

    def residual(errors: np.ndarray | float) -> np.ndarray:
        moved = dict(zip(columns, np.stack(list(columns.values())) + errors, strict=True))
        motion = trial.moved(clock, moved).part(inside)
        return about(total - motion.required, motion.centre)

    angle = np.array([n.removeprefix("q_") not in TRANSLATIONS for n in columns])
    base, draws = residual(0.0), kind(turn, angle, np.random.default_rng(seed))
    return strides.first(np.stack([residual(one) - base for one in draws], axis=2))
