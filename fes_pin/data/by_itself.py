"""What a trial of a rig states by itself, without a model: each a mean of the readings with its standard error."""

import numpy as np

from fes_pin.data.trial import Trial

PULSES = ("pulse_width_us", "amplitude_ma", "charge_uc", "stim", "frequency_hz", "emg", "emg_envelope")
"""Inputs without which nothing happens: a muscle contracts where it is stimulated."""
STILL = 0.02
"""Share of a trial's range below which a part of it stands still."""
FEWEST = 3
"""Samples of a mean with a scatter."""

Mean = tuple[float, float]
"""A mean and its standard error."""


def before_pulses(trial: Trial, name: str) -> Mean | None:
    """Return the mean of a reading before the first pulse of a trial; None without samples there, or where it moves."""
    pulses = next((trial[n] for n in PULSES if n in trial), np.zeros(1))
    rest = trial[name][: int(np.argmax(pulses != 0.0))]
    begin, end = (_mean(half) for half in np.array_split(rest, 2))
    moves = begin is None or end is None or abs(begin[0] - end[0]) > STILL * np.ptp(trial[name])
    return None if moves else _mean(rest)


def resting(trial: Trial, name: str, part: slice, still: str = "position") -> Mean | None:
    """Return the mean of a reading in a part of a trial in which another one stands still; None where that moves."""
    mean = _mean(trial[name][part])
    return None if mean is None or np.ptp(trial[still][part]) > STILL * np.ptp(trial[still]) else mean


def _mean(values: np.ndarray) -> Mean | None:
    n = len(values)
    return (float(np.mean(values)), float(np.std(values, ddof=1) / np.sqrt(n))) if n >= FEWEST else None
