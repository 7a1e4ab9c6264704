"""Changes of the residual by errors in the coordinates: soft tissue, white noise, misplaced landmarks."""

from collections.abc import Callable, Iterator

import numpy as np

from fes_pin.data.motion import TRANSLATIONS
from fes_pin.walk.dynamics import about
from fes_pin.walk.recording import WalkRecording
from fes_pin.walk.strides import Strides

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
SMALL_N = 1.0
"""Ordinary errors with a smaller residual in all waves together are left out, N or N m."""

CoordinateErrors = Iterator[dict[str, np.ndarray]]
Disturbance = Callable[[np.ndarray, bool, np.random.Generator], np.ndarray]
"""Function of the phase in the stride, (n,), whether a coordinate is an angle, and a generator: its error, (n,)."""


def tissue(phase: np.ndarray, angle: bool, random: np.random.Generator) -> np.ndarray:
    """Return an error that repeats in each stride."""
    out = np.zeros(len(phase))
    for h in range(1, TISSUE_WAVES + 1):
        a, b = random.normal(size=2) / h
        out += a * np.cos(2.0 * np.pi * h * phase) + b * np.sin(2.0 * np.pi * h * phase)
    return (TISSUE_RAD if angle else TISSUE_M) * out


def white(phase: np.ndarray, angle: bool, random: np.random.Generator) -> np.ndarray:
    """Return white noise as of markers with 1 mm."""
    return 1e-3 * random.normal(size=len(phase)) / (CLUSTER_M if angle else 1.0)


def disturbed_waves(recording: WalkRecording, strides: Strides, kind: Disturbance, draws: int, seed: int) -> np.ndarray:
    """Return changes of the residual's waves in the first stride by random errors of all coordinates: (draws, 6, k)."""
    random = np.random.default_rng(seed)

    def errors(names: list[str], phase: np.ndarray) -> CoordinateErrors:
        for _ in range(draws):
            yield {n: kind(phase, _is_angle(n), random) for n in names}

    return _responses(recording, strides, errors)


def misplaced(recording: WalkRecording, strides: Strides) -> np.ndarray:
    """Return changes of the residual's waves by the ordinary error of each coordinate's zero: (coordinates, 6, k)."""

    def errors(names: list[str], phase: np.ndarray) -> CoordinateErrors:
        for n in names:
            yield {n: np.full(len(phase), LANDMARK_RAD if _is_angle(n) else LANDMARK_M)}

    return _responses(recording, strides, errors)


def _is_angle(name: str) -> bool:
    return name.removeprefix("q_") not in TRANSLATIONS


def _responses(
    recording: WalkRecording, strides: Strides, errors: Callable[[list[str], np.ndarray], CoordinateErrors]
) -> np.ndarray:
    """Return changes of the residual's waves in the first stride by errors of the coordinates: (errors, 6, k)."""
    _, rows, phase = strides.windows[0]
    time = recording.motion.time[rows]
    near = (recording.time >= time[0] - PAD_S) & (recording.time <= time[-1] + PAD_S)
    clock = recording.time[near]
    columns = {n: c[near] for n, c in recording.coordinates.items() if n.startswith("q_")}
    turn = (clock - time[0]) / ((time[-1] - time[0]) * len(time) / (len(time) - 1)) + phase[0]
    inside = (clock >= time[0] - 1e-9) & (clock <= time[-1] + 1e-9)
    total = recording.plates.total[rows]

    def residual(own: dict[str, np.ndarray]) -> np.ndarray:
        motion = recording.moved(clock, {n: c + own.get(n, 0.0) for n, c in columns.items()}).part(inside)
        return about(total - motion.required, motion.centre)

    base = residual({})
    return strides.first(np.stack([residual(one) - base for one in errors(list(columns), turn)], axis=2))


def compressed(columns: np.ndarray) -> np.ndarray:
    """Return fewer columns of nearly the same covariance."""
    flat = columns.reshape(-1, columns.shape[-1])
    vectors, sizes, _ = np.linalg.svd(flat, full_matrices=False)
    kept = sizes > SMALL_N
    return (vectors[:, kept] * sizes[kept]).reshape(*columns.shape[:-1], -1)
