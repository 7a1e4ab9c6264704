"""Signals of a walk by stride, as waves of the stride: means over strides, and differences between them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.interpolate import make_interp_spline

from fes_pin.body.joints import SIDES
from fes_pin.walk.plates import Plates
from fes_pin.walk.walk_trial import WalkTrial

STILL_S = 1.2
"""Length of a window where nobody steps, s: about a stride."""
STILL_MPS = 0.05
"""m/s; one whose centre of mass varies its speed by less stands: swaying is slower by half, walking faster by four."""
DEBOUNCE_S = 0.15
"""Two contacts of one foot lie further apart than this."""


@dataclass(frozen=True)
class Strides:
    """Windows of one stride each, and the waves into which signals are decomposed.

    Attributes
    ----------
    windows
        For each stride the number of its trial, its samples, and the phase of each in [0, 1).
    harmonics
        (k,) number of waves in a stride of every coefficient: 0, 1, 1, 2, 2, ...
    whole
        Whether a window ends as it began, so that momentum returns to its value: a whole stride, or standing.
    """

    windows: list[tuple[int, slice, np.ndarray]] = field(repr=False)
    harmonics: np.ndarray
    whole: bool = True

    @property
    def count(self) -> int:
        """Number of strides."""
        return len(self.windows)

    @cached_property
    def _inverses(self) -> list[np.ndarray]:
        return [np.linalg.pinv(_waves(phase, self.harmonics)) for _, _, phase in self.windows]

    def coefficients(self, signals: Sequence[np.ndarray]) -> np.ndarray:
        """Return coefficients of signals (n, 6, p) of each trial: (strides, 6, k, p); their squares sum to the mean
        square."""
        out = []
        for (trial, rows, _), inverse in zip(self.windows, self._inverses, strict=True):
            values = signals[trial][rows]
            flat = inverse @ values.reshape(len(values), int(np.prod(values.shape[1:])))
            out.append(np.moveaxis(flat.reshape(len(self.harmonics), *values.shape[1:]), 0, 1))
        return np.array(out)

    def first(self, values: np.ndarray) -> np.ndarray:
        """Return coefficients of signals (n, 6, draws) that are known in the first stride only: (draws, 6, k)."""
        flat = self._inverses[0] @ values.reshape(len(values), -1)
        return np.moveaxis(flat.reshape(len(self.harmonics), *values.shape[1:]), (0, 2), (2, 0))

    def mean(self, signals: Sequence[np.ndarray]) -> np.ndarray:
        """Return the mean coefficients over strides: (1, 6, k, p)."""
        return self.coefficients(signals).mean(axis=0, keepdims=True)


def _waves(phase: np.ndarray, harmonics: np.ndarray) -> np.ndarray:
    """Orthonormal waves of a stride: 1, root 2 cos, root 2 sin, ...: (samples, k)."""
    out = np.empty((len(phase), len(harmonics)))
    for k, h in enumerate(harmonics):
        wave = np.cos if k % 2 else np.sin
        out[:, k] = 1.0 if h == 0 else np.sqrt(2.0) * wave(2.0 * np.pi * h * phase)
    return out


def strides_of(trials: Sequence[WalkTrial], cutoff_hz: float) -> Strides:
    """Cut walks into whole strides; phase 0 is a contact of the right foot (else of the left, half a stride later).

    A record without two contacts, as of one standing still, is cut into windows of 1.2 s.
    """
    windows, longest, whole = [], [], True
    for number, trial in enumerate(trials):
        time = trial.motion.time
        phase = _phase(time, trial.plates)
        first, last = phase[0], phase[-1] + (phase[-1] - phase[-2])
        count = int(np.floor(last - first + 1e-6))
        whole &= count > 0 and (_steps(time, trial.plates) or _stands(trial))
        for k in range(count):
            inside = np.flatnonzero((phase >= first + k) & (phase < first + k + 1 - 1e-9))
            rows = slice(int(inside[0]), int(inside[-1]) + 1)
            windows.append((number, rows, phase[rows] % 1.0))
            longest.append((time[rows][-1] - time[rows][0], len(inside)))
        if not count:
            windows.append((number, slice(0, len(time)), (phase - first) / (last - first)))
            longest.append((time[-1] - time[0], len(time)))
    waves = min(max(1, int(cutoff_hz * length)) for length, _ in longest)
    waves = min(waves, *((samples - 2) // 3 for _, samples in longest))
    return Strides(windows, np.array([0, *(h for h in range(1, waves + 1) for _ in range(2))]), whole)


def _steps(time: np.ndarray, plates: Plates) -> bool:
    """Return whether contacts determine a stride's length: two of a foot, or one of each."""
    counts = [len(_contacts(time, plates.loaded[side])) for side in SIDES]
    return max(counts) > 1 or min(counts) > 0


def _stands(trial: WalkTrial) -> bool:
    return bool(np.std(np.gradient(trial.centre, trial.dt, axis=0), axis=0).max() < STILL_MPS)


def _phase(time: np.ndarray, plates: Plates) -> np.ndarray:
    """Strides since the first contact: (n,)."""
    best: np.ndarray = np.zeros(0)
    for side, later in zip(reversed(SIDES), (0.0, 0.5), strict=True):
        at = _contacts(time, plates.loaded[side])
        if len(at) > len(best) and len(at) > 1:
            best, shift = at, later
    if len(best) < 2:
        both = [(_contacts(time, plates.loaded[side])) for side in SIDES]
        if all(len(at) for at in both):
            half = abs(both[0][0] - both[1][0])
            return (time - both[1][0]) / (2.0 * half)
        return (time - time[0]) / min(STILL_S, time[-1] - time[0] + (time[1] - time[0]))
    return make_interp_spline(best, np.arange(len(best)), k=1)(time) + shift


def _contacts(time: np.ndarray, loaded: np.ndarray) -> np.ndarray:
    """Times at which a foot comes down."""
    at = time[1:][loaded[1:] & ~loaded[:-1]]
    kept: list[float] = []
    for t in at:
        if not kept or t - kept[-1] > DEBOUNCE_S:
            kept.append(float(t))
    return np.array(kept)
