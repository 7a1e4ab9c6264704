"""Stimuli: what a pulse width recruits, and stimuli of a shape from 0 (off) to 1 and trains for proposed trials."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from fes_pin.data.study import Study
from fes_pin.models.maths import clip
from fes_pin.models.stage import Signals

RATES_HZ = (8.0, 15.0, 31.0, 45.0)
"""Pulse rates that are proposed, from single twitches to a fused contraction."""
ON_AND_PAUSE_S = ((7.0, 1.0), (1.0, 1.0), (0.3, 0.7))
"""Length of trains, and the pause after each, s."""
LAST_S = 0.8
"""A proposed train ends so long before the trial does: the muscle's relaxation is seen."""


def shaped(study: Study, column: str, shape: np.ndarray) -> np.ndarray:
    """Values of an input column of a shape from 0 (off) to 1, shape (n,): 0 where the shape is.

    Pulse widths go from threshold to saturation, us; others are of both signs, up to the largest that the study has.
    """
    if column == "pulse_width_us":
        low = float(study.constants.get("threshold_us", 180.0))
        high = float(study.constants.get("saturation_us", 1000.0))
        return np.where(shape > 0, np.round(low + (high - low) * shape), 0.0)
    size = max(float(np.abs(t[column]).max()) for t in study.trials if column in t)
    return np.where(shape > 0, size * (2.0 * shape - 1.0), 0.0)


def recruitment_of(width: Any, threshold_us: Any, saturation_us: Any) -> Any:
    """Recruitment by pulse widths, 0 at the threshold to 1 at saturation."""
    return clip((width - threshold_us) / (saturation_us - threshold_us), 0.0, 1.0)


def recruited_now(s: Signals) -> Any:
    """Recruitment by the pulse width of this sample."""
    s.commanded = s.u.pulse_width_us
    return recruitment_of(s.through("pulse_width", s.commanded), s.c.threshold_us, s.c.saturation_us)


def trains(time: np.ndarray) -> Iterator[np.ndarray]:
    """Trains of pulses, 1 in the sample of each, shape (n,)."""
    end = 2.0 * time[-1] - time[-2]
    for rate_hz in RATES_HZ:
        pulse = np.diff(np.floor(time * rate_hz), prepend=-1.0) > 0
        for on_s, pause_s in ON_AND_PAUSE_S:
            on = (time % (on_s + pause_s) < on_s) & (time < end - LAST_S)
            yield np.where(pulse & on, 1.0, 0.0)
