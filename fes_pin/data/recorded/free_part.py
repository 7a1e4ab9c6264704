"""Where the free motion of a rig begins that rests first, is pushed by hand, and then swings or runs out by itself.

A passive rig that rests where it also ends does not begin to move by itself: what moves it first is no part of the
model. From its largest deviation on, energy only falls.
"""

from __future__ import annotations

import numpy as np

from fes_pin.data.recorded.parts import REST_S, STILL

SETTLED = 0.05
"""Share of the largest deviation within which the end counts as the place of rest that the record began at."""
PUSHES = 3
"""Deviations of half the largest one and more by which a hand brings it there; who walks or works makes more."""
LARGER = 0.99
"""Share of the largest deviation from which a sample counts as being at it."""


def free_from(time: np.ndarray, position: np.ndarray) -> float | None:
    """Time at which the free motion begins, s; None of a record that does not begin at rest at the place of its end.

    None as well where samples are missing.

    Parameters
    ----------
    time, position
        Shape (n,), times (0,) where they are no numbers; nothing drives the rig.
    """
    if not len(time) or not (np.isfinite(time).all() and np.isfinite(position).all()):
        return None
    count = round(REST_S / max(float(np.median(np.diff(time))), 1e-12))
    if count < 2 or len(time) < 4 * count:
        return None
    reach = float(np.ptp(position))
    first, last = position[:count], position[-count:]
    if reach <= 0.0 or np.ptp(first) > STILL * reach or abs(float(np.mean(last) - np.mean(first))) > SETTLED * reach:
        return None
    away = np.abs(position - np.mean(first))
    is_far = away[int(np.argmax(away)) :] >= LARGER * away.max()
    begin = int(np.argmax(away)) + int(np.argmin(is_far)) - 1  # the end of a plateau: a hand may hold it there
    if not count < begin < len(time) - count:
        return None
    is_push = len(_peaks(away[: begin + 1], 0.5 * away.max())) <= PUSHES
    away = position - np.mean(first)
    return float(time[begin]) if is_push and _falls(away[begin:], reach, count) else None


def _peaks(side: np.ndarray, least: float) -> np.ndarray:
    """The largest deviation of each stretch, shape (m,), in which deviations to one side, (n,), are above the least."""
    edges = np.flatnonzero(np.diff(np.r_[False, side > least, False].astype(int)))
    return np.array([side[a:b].max() for a, b in zip(edges[::2], edges[1::2], strict=True)])


def _falls(away: np.ndarray, reach: float, count: int) -> bool:
    """Whether deviations from the place of rest, (n,), are those of a motion whose energy falls, to the end.

    On each side none is larger than an earlier one, and none follows where it has come to rest, for so many samples.
    """
    least = SETTLED * reach
    for peaks in (_peaks(away, least), _peaks(-away, least)):
        if np.any(peaks[1:] > np.minimum.accumulate(peaks)[:-1] + least):
            return False
    windows = np.lib.stride_tricks.sliding_window_view(away, count)
    rests = (np.ptp(windows, axis=1) < STILL * reach) & (np.abs(windows).max(axis=1) < least)
    return not rests.any() or bool(np.abs(away[int(np.argmax(rests)) :]).max() < 2.0 * least)
