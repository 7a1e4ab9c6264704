"""Motion that the rig is made to follow: smoothed, with its rates, and with the uncertainty of each.

A dynamometer, a muscle lever or a test stand imposes the motion; what is measured is the force that it takes. A model
needs velocity and acceleration of the motion: they come from a smoothing spline of the reading, whose bandwidth
cross-validation sets (`data.smooth`). A velocity that was measured as well is smoothed by itself, and replaces the one
from the position. Noise that smoothing leaves in them acts on a model's force; it is estimated together with the
process noise and the measurement noise of the force.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from fes_pin.data.channels import ENVELOPE, until_next
from fes_pin.data.trial import Trial

MOTION = ("imposed", "imposed_rate", "imposed_acceleration")
"""What a model is driven by in such a trial, whatever the column's name: position, velocity, acceleration."""

REMEMBERED = 256
"""Readings whose smoothing is remembered, 40 bytes a sample."""
_KNOWN = "_imposed_motion"
"""Where a trial keeps its own: that of another trial, so far further, is not what smoothing finds to the last digit."""


@dataclass(frozen=True)
class ImposedMotion:
    """An imposed motion.

    Attributes
    ----------
    values
        Shape (3, n): position, velocity and acceleration, as `MOTION` names them.
    std
        Standard deviations of the noise that stays in each.
    bandwidth_hz
        Of velocity and acceleration.
    """

    values: np.ndarray
    std: tuple[float, float, float]
    bandwidth_hz: float

    @property
    def start(self) -> float:
        """Position at the first sample."""
        return float(self.values[0, 0])

    def known(self, time: np.ndarray) -> np.ndarray:
        """True where velocity and acceleration are as sure as `std` says, shape (n,).

        Within one knot of either end, half a period of the bandwidth, a spline has no neighbours on one side, and its
        acceleration is several times as uncertain. At most a tenth of a trial is given away at each end.
        """
        margin = min(0.5 / self.bandwidth_hz, 0.1 * (time[-1] - time[0]))
        return (time >= time[0] + margin) & (time <= time[-1] - margin)


def imposed_motion(trial: Trial, columns: tuple[str, ...]) -> ImposedMotion:
    """The motion that a trial imposes.

    Parameters
    ----------
    columns
        Names of the columns that may hold it: the position, and perhaps its velocity.
    """
    known = vars(trial).get(_KNOWN)
    if known is None:
        known = vars(trial)[_KNOWN] = _smoothed(trial, columns)
    return known


def same_motion(trial: Trial, other: Trial, further: float = 0.0) -> Trial:
    """A trial whose imposed motion is that of another, so far further: what is known of that is not sought again."""
    if (known := vars(other).get(_KNOWN)) is not None:
        vars(trial)[_KNOWN] = replace(known, values=known.values + np.array([[further], [0.0], [0.0]]))
    return trial


def moved_along(trial: Trial, values: np.ndarray) -> Trial:
    """A trial with a known imposed motion: position, velocity and acceleration, shape (3, n)."""
    vars(trial)[_KNOWN] = ImposedMotion(values, (0.0, 0.0, 0.0), float("inf"))
    return trial


def driving_values(trial: Trial, name: str, columns: tuple[str, ...]) -> np.ndarray:
    """What drives a model under one name, shape (n,): a column, or a part of the imposed motion.

    A stimulus is held from one sample to the next. An EMG goes on: its mean until the next sample drives.
    """
    if name in MOTION:
        return imposed_motion(trial, columns).values[MOTION.index(name)]
    return until_next(trial[name]) if name == ENVELOPE else trial[name]


def _smoothed(trial: Trial, columns: tuple[str, ...]) -> ImposedMotion:
    measured = [(trial[n].tobytes(), trial.time.tobytes()) for n in columns if n in trial]
    values, std, bandwidth = _rates(*measured[0])
    if len(measured) > 1:
        rate, rate_std, bandwidth = _rates(*measured[1])
        values, std = np.stack([values[0], rate[0], rate[1]]), np.array([std[0], rate_std[0], rate_std[1]])
    return ImposedMotion(values, (float(std[0]), float(std[1]), float(std[2])), bandwidth)


@lru_cache(maxsize=REMEMBERED)
def _rates(reading: bytes, time: bytes) -> tuple[np.ndarray, np.ndarray, float]:
    """What `smoothed_rates` gives of numbers and times; a trial with some outputs hidden has the same motion."""
    from fes_pin.data.smooth import smoothed_rates  # noqa: PLC0415 - half a second of SciPy, for imposed motion alone

    return smoothed_rates(np.frombuffer(reading), np.frombuffer(time))
