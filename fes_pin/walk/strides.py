"""Signals of a walk by stride, as waves of the stride: means over strides, and differences between them.

The design matrix of a set of forms is made of means.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.interpolate import make_interp_spline

from fes_pin.body.joints import SIDES
from fes_pin.walk.effect import Form
from fes_pin.walk.walk_trial import WalkTrial

STILL_S = 1.2
"""Length of a window where nobody steps, s: about a stride."""
STILL_MPS = 0.05
"""m/s; one whose centre of mass varies its speed by less stands: swaying is slower by half, walking faster by four."""
DEBOUNCE_S = 0.15
"""Two contacts of one foot lie further apart than this."""


@dataclass(frozen=True)
class Design:
    """Design matrix: residual and columns of every form by name, (1, 6, k, ...) in the mean stride.

    The plates are read `later_s` later than their clock says.
    """

    trials: Sequence[WalkTrial] = field(repr=False)
    y: np.ndarray = field(repr=False)
    x: dict[str, np.ndarray] = field(repr=False)
    later_s: float = 0.0


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
        """Return coefficients of signals (n, 6, ...) of each trial; their squares sum to the mean square.

        Returns
        -------
        ndarray
            Shape (strides, 6, k, ...).
        """
        pairs = zip(self.windows, self._inverses, strict=True)
        out = [np.tensordot(inverse, signals[trial][rows], 1) for (trial, rows, _), inverse in pairs]
        return np.array(out).swapaxes(1, 2)

    def first(self, values: np.ndarray) -> np.ndarray:
        """Return coefficients of signals (n, 6, draws) that are known in the first stride only: (draws, 6, k)."""
        return np.tensordot(self._inverses[0], values, 1).transpose(2, 1, 0)

    def mean(self, signals: Sequence[np.ndarray]) -> np.ndarray:
        """Return the mean coefficients over strides: (1, 6, k, ...)."""
        return self.coefficients(signals).mean(axis=0, keepdims=True)

    def mean_design(self, trials: Sequence[WalkTrial], forms: Iterable[Form]) -> Design:
        """Return the residual of trials and the columns of forms in the mean stride."""
        x = {form.label: self.mean([form.columns(s) for s in trials]) for form in forms}
        return Design(trials, self.mean([s.residual for s in trials]), x)


def _waves(phase: np.ndarray, harmonics: np.ndarray) -> np.ndarray:
    """Orthonormal waves of a stride: 1, root 2 cos, root 2 sin, ...: (samples, k)."""
    angle, is_cosine = 2.0 * np.pi * np.outer(phase, harmonics), np.arange(len(harmonics)) % 2 == 1
    waves = np.sqrt(2.0) * np.where(is_cosine, np.cos(angle), np.sin(angle))
    return np.where(harmonics == 0, 1.0, waves)


def strides_of(trials: Sequence[WalkTrial], cutoff_hz: float) -> Strides:
    """Cut walks into whole strides; phase 0 is a contact of the right foot (else of the left, half a stride later).

    A record without two contacts, as of one standing still, is cut into windows of 1.2 s.
    """
    windows, whole = [], True
    for number, trial in enumerate(trials):
        contacts = {side: _contacts(trial.motion.time, trial.plates.loaded[side]) for side in SIDES}
        phase = _phase(trial.motion.time, contacts)
        first, last = phase[0], phase[-1] + (phase[-1] - phase[-2])
        count, counts = int(np.floor(last - first + 1e-6)), [len(at) for at in contacts.values()]
        # contacts determine a stride's length: two of a foot, or one of each
        steps = max(counts) > 1 or min(counts) > 0
        whole &= count > 0 and (steps or _stands(trial))
        for k in range(count):
            inside = np.flatnonzero((phase >= first + k) & (phase < first + k + 1 - 1e-9))
            rows = slice(int(inside[0]), int(inside[-1]) + 1)
            windows.append((number, rows, phase[rows] % 1.0))
        if not count:
            windows.append((number, slice(0, len(phase)), (phase - first) / (last - first)))
    times = [trials[number].motion.time[rows] for number, rows, _ in windows]
    waves = min(min(max(1, int(cutoff_hz * (t[-1] - t[0]))), (len(t) - 2) // 3) for t in times)
    return Strides(windows, np.array([0, *(h for h in range(1, waves + 1) for _ in range(2))]), whole)


def _stands(trial: WalkTrial) -> bool:
    return bool(np.std(np.gradient(trial.motion.centre, trial.motion.dt, axis=0), axis=0).max() < STILL_MPS)


def _phase(time: np.ndarray, contacts: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return strides since the first contact, by the foot with more contacts: (n,)."""
    left, right = contacts["left"], contacts["right"]
    at, later = (left, 0.5) if len(left) > len(right) else (right, 0.0)
    if len(at) > 1:
        return make_interp_spline(at, np.arange(len(at)), k=1)(time) + later
    if len(left) and len(right):
        return (time - right[0]) / (2.0 * abs(left[0] - right[0]))
    return (time - time[0]) / min(STILL_S, time[-1] - time[0] + (time[1] - time[0]))


def _contacts(time: np.ndarray, loaded: np.ndarray) -> np.ndarray:
    """Return the times at which a foot comes down."""
    at = time[1:][loaded[1:] & ~loaded[:-1]]
    return at[np.diff(at, prepend=-np.inf) > DEBOUNCE_S]
