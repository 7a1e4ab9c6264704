"""Stimulation of a muscle in a session before a trial, by its age.

A muscle that tires in one trial may be tired in the next. Where trials state when they began (`start_s`), the
recruitment of all earlier ones is known, and with it the initial states of effects with a longer memory than a trial.
Such a state follows first-order equations with constant rates within a bin of the past, so that the mean recruitment of
a bin gives the state at its end exactly. Recruitment replaces the activation, which follows it within a tenth of a
second. In a trial without a time of beginning the muscle starts unfatigued. So it does in all trials if trials overlap,
as they then belong to more than one session.
"""

import math
from collections.abc import Callable, Sequence
from numbers import Real
from typing import Any

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.trial import Trial
from fes_pin.models.maths import exp

# stretches of stimulation: begin and end in s, as `start_s` counts them, and mean recruitment
Session = tuple[tuple[float, float, float], ...]
NEWEST_S, GROWTH, BINS = 0.2, 1.25, 45
"""Length of the newest bin of the past in s, ratio of successive lengths, and number of bins: together an hour, twelve
times the longest recovery that is searched. Within a bin an exponential of its own age differs from its mean by at most
4 %."""
EDGES = np.concatenate([[0.0], NEWEST_S * GROWTH ** np.arange(BINS)])
"""Ages of the ends of the bins, s."""
PAST = tuple(f"past_{k:02d}" for k in range(BINS))
"""Names of the constants of a trial that hold the mean recruitment of each bin, newest first."""
PIECES, SHORTEST_S = 20, 0.25
"""Most pieces in which a trial is kept, and their least length, s."""


def checked_session(rows: Sequence[Sequence[float]]) -> Session:
    """Return checked stretches of stimulation: each a begin, a later end and a mean recruitment.

    Raises
    ------
    InputError
        For one that is not, or whose numbers are not finite.
    """
    out: list[tuple[float, float, float]] = []
    for row in rows if isinstance(rows, list | tuple) else [()]:
        numbers = [float(v) for v in row if isinstance(v, Real)] if isinstance(row, list | tuple) else []
        if len(numbers) != 3 or not all(map(math.isfinite, numbers)) or not numbers[0] < numbers[1]:
            message = "expected rows of a begin, a later end and a mean recruitment, all finite"
            raise InputError(message, column="session")
        out.append((numbers[0], numbers[1], numbers[2]))
    return tuple(out)


def session_of(trials: Sequence[Trial], recruited: Callable[[Trial], np.ndarray]) -> Session:
    """Return the stimulation of trials that state when they began; none where two of them overlap.

    Parameters
    ----------
    recruited
        Returns the recruitment of a trial, shape (n,), by its stimulus.
    """
    known = sorted((t for t in trials if "start_s" in t.conditions), key=lambda t: t.conditions["start_s"])
    ends = [t.conditions["start_s"] + t.duration for t in known]
    if any(end > after.conditions["start_s"] + after.dt for end, after in zip(ends, known[1:], strict=False)):
        return ()
    out: list[tuple[float, float, float]] = []
    for trial in known:
        count = int(np.clip(round(trial.duration / SHORTEST_S), 1, PIECES))
        pieces = [p for p in np.array_split(recruited(trial), count) if len(p)]
        begins = trial.conditions["start_s"] + trial.dt * np.cumsum([0, *map(len, pieces)])
        out += [(float(a), float(b), float(p.mean())) for a, b, p in zip(begins, begins[1:], pieces, strict=False)]
    return tuple(out)


def past_of(session: Session, trial: Trial) -> dict[str, float]:
    """Return mean recruitment in each bin of a trial's past, by the names of `PAST`; zero without a stated start."""
    if "start_s" not in trial.conditions or not session:
        return dict.fromkeys(PAST, 0.0)
    now = trial.conditions["start_s"]
    begin, end, mean = np.array(session).T
    before = begin < now - 0.5 * trial.dt  # the trial itself begins now
    old, new = now - begin[before, None], np.maximum(now - end[before, None], 0.0)
    shared = np.maximum(np.minimum(old, EDGES[1:]) - np.maximum(new, EDGES[:-1]), 0.0)
    return dict(zip(PAST, map(float, mean[before] @ shared / np.diff(EDGES)), strict=True))


def after_the_past(s: Any, rate: Callable[[Any], Any], towards: Callable[[Any], Any]) -> Any:
    """Return the initial state of a trial after x' = rate(act) (towards(act) - x) from 0 through the past.

    Parameters
    ----------
    s
        The signals: `s.c` holds the constants of `PAST`.
    rate, towards
        Functions of an activation: a rate, 1/s, and the stationary state.
    """
    state: Any = 0.0
    for name, width in zip(reversed(PAST), np.diff(EDGES)[::-1], strict=True):
        act = getattr(s.c, name)
        end = towards(act)
        state = end + (state - end) * exp(-float(width) * rate(act))
    return state
