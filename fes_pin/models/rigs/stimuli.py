"""Stimuli: what pulses recruit, and stimuli of a shape from 0 (off) to 1 and trains for proposed trials."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from fes_pin.data.channels import CHANNELS, ENVELOPE, RATE, Channel, until_next
from fes_pin.data.stimulus import usual_rate
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.models.maths import clip
from fes_pin.models.stage import Signals

RATES_HZ = (8.0, 15.0, 31.0, 45.0)
"""Pulse rates that are proposed, from single twitches to a fused contraction."""
ON_AND_PAUSE_S = ((7.0, 1.0), (1.0, 1.0), (0.3, 0.7))
"""Length of trains, and the pause after each, s."""
AT_START = "recruited_at_start"
"""Constant of a trial: its first recruitment, by an EMG. A muscle that nobody stimulates may hold when a trial begins;
one that is stimulated rests until then."""
LAST_S = 0.8
"""A proposed train ends so long before the trial does: the muscle's relaxation is seen."""


def shaped(study: Study, column: str, shape: np.ndarray) -> np.ndarray:
    """Values of an input column of a shape from 0 (off) to 1, shape (n,): 0 where the shape is.

    What recruits goes from threshold to saturation, pulse widths in whole us and others in thousandths of their unit; a
    rate goes up to the largest that the study has. Others are of both signs, up to the largest that the study has.
    """
    size = max((float(np.abs(t[column]).max()) for t in study.trials if column in t), default=0.0)
    if column in CHANNELS:
        low, high = (float(study.constants[end]) for end in CHANNELS[column].ends)
        decimals = 0 if column == "pulse_width_us" else 3
        return np.where(shape > 0, np.round(low + (high - low) * shape, decimals), 0.0)
    if column == RATE:
        return np.where(shape > 0, np.round(size * shape, 3), 0.0)
    return np.where(shape > 0, size * (2.0 * shape - 1.0), 0.0)


def recruitment_of(size: Any, threshold: Any, saturation: Any) -> Any:
    """Recruitment by pulses of a width, an amplitude or a charge, 0 at the threshold to 1 at saturation."""
    return clip((size - threshold) / (saturation - threshold), 0.0, 1.0)


def recruited_now(s: Signals, channel: Channel | None) -> Any:
    """Recruitment by the stimulus of this sample, times its rate over the usual one where that was recorded.

    A pulse is an impulse of area P, the usual pulse period, times what it recruits: the mean of a train is proportional
    to its rate (Bobet and Stein, IEEE Trans. Biomed. Eng. 45 (1998) 1010: a linear lag, what saturates comes after it).

    Parameters
    ----------
    channel
        That recruits; None of a muscle without a curve, which recorded pulses or a rate alone drive.
    """
    if hasattr(s.u, "stim"):
        return s.u.stim * s.c.pulse_period_s / s.c.dt
    if hasattr(s.u, ENVELOPE):
        return getattr(s.u, ENVELOPE)
    rate = getattr(s.u, RATE, None)
    recruited: Any = 0.0 if rate is None else 1.0
    s.commanded, s.saturation, s.least = 0.0, 1.0, 1.0
    if channel is not None and hasattr(s.u, channel.column):
        s.commanded, (low, high) = getattr(s.u, channel.column), (getattr(s.c, end) for end in channel.ends)
        s.saturation, s.least = high, channel.per_us
        recruited = recruitment_of(s.through("pulse_width", s.commanded), low, high)
    return recruited if rate is None else recruited * rate * s.c.pulse_period_s


def recruited_in(trial: Trial, channel: Channel | None, constants: Mapping[str, float]) -> np.ndarray:
    """Recruitment of a whole trial, as `recruited_now` has it, without causes, shape (n,)."""
    if "stim" in trial:
        return np.asarray(trial["stim"] * constants["pulse_period_s"] / trial.dt)
    if ENVELOPE in trial:
        return until_next(trial[ENVELOPE])
    recruited = np.full(len(trial), float(RATE in trial))
    if channel is not None and channel.column in trial:
        low, high = (float(constants[end]) for end in channel.ends)
        recruited = np.asarray(recruitment_of(trial[channel.column], low, high))
    return recruited * trial[RATE] * constants["pulse_period_s"] if RATE in trial else recruited


def at_start(trial: Trial) -> dict[str, float]:
    """The first recruitment of a trial, by its name; 0 of one without columns, as a controller begins."""
    columns = getattr(trial, "columns", {})
    return {AT_START: float(columns[ENVELOPE][0]) if ENVELOPE in columns else 0.0}


def rest_muscle(s: Signals) -> None:
    """Put the muscle where its first recruitment, held for long, would have it."""
    held = getattr(s.c, AT_START, None)
    s.x.act = s.m.r = s.m.r_before = 0.0 if held is None else s.through("recruitment", held)


def usual_period(trials: Sequence[Trial]) -> dict[str, float]:
    """The pulse period s of the usual rate of trials, as the constant of a rig; empty where no rate was recorded."""
    rate = usual_rate(trials)
    return {"pulse_period_s": 1.0 / rate} if rate else {}


def trains(time: np.ndarray) -> Iterator[np.ndarray]:
    """Trains of pulses, 1 in the sample of each, shape (n,)."""
    end = 2.0 * time[-1] - time[-2]
    for rate_hz in RATES_HZ:
        pulse = np.diff(np.floor(time * rate_hz), prepend=-1.0) > 0
        for on_s, pause_s in ON_AND_PAUSE_S:
            on = (time % (on_s + pause_s) < on_s) & (time < end - LAST_S)
            yield np.where(pulse & on, 1.0, 0.0)
