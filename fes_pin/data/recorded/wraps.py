"""Angles that wrap: a reading that returns by a whole turn, or by the range of a counter, and goes on from there.

A reading that wraps lies in a range as long as its jumps. With whole periods added its second differences at the jumps
are like those elsewhere. A spike, a dropout, a stop or a coarse sensor has no jumps of one length that leave a
continuous motion. A velocity that follows the motion there too confirms it.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fes_pin.data.counts import count_of
from fes_pin.data.table import Table

TURNS = {2.0 * math.pi: "360 deg", 360.0: "360"}
"""A whole turn in rad, and one in degrees that stand where rad are stated; in words."""
ANGLES = ("position", "angle_rad")
"""Columns that hold an angle: `position` where the joint turns."""
FEWEST = 10
"""Samples of a reading that is looked at, at least."""
USUAL, TIMES = 0.99, 3.0
"""Share of angles and of second differences that are usual, and the multiple of these that one at a jump may reach:
Gaussian noise leaves the threefold of its 99 % once in 1e14 samples."""
COARSE = 0.125
"""Largest second difference at a jump, as a share of the period: a motion that bends more is not told from a jump."""
SHORTEST_COUNTER = 256
"""Range of a counter that wraps, in counts, at least: 8 bits."""
ROUND = (100, 10, 1)
"""What the range of other counters is a multiple of, the first that jumps allow."""
EIGHTHS = 8
"""Parts of the range of a counter that is no power of two; a reading that wraps by turning round visits each."""
FOLLOWS = 0.5
"""Share of the mean square of steps that a velocity explains, from which it is one of this motion."""
LONG = 2.0
"""Periods from which an unwrapped motion turns round."""


class Continuous(NamedTuple):
    """A reading without jumps, shape (n,), the period that was added, and what is said of it."""

    values: np.ndarray
    period: float
    said: str

    def near(self, other: float) -> np.ndarray:
        """Return the reading, moved by whole periods next to an angle; one that turns round stays."""
        if np.nanmax(self.values) - np.nanmin(self.values) > LONG * self.period:
            return self.values
        return self.values - self.period * round((middle(self.values) - other) / self.period)


def middle(values: np.ndarray) -> float:
    """Return the middle of the range of a motion, shape (n,), that spikes are not part of: see `USUAL`."""
    return float(np.nanquantile(values, (1.0 - USUAL, USUAL)).mean())


def table_without_wraps(table: Table, revolute: bool | None) -> Table:
    """Return a table whose angles do not wrap: nothing may be interpolated across a jump.

    Parameters
    ----------
    revolute
        Whether the rig's joint turns, so that `position` is an angle.
    """
    columns, said = dict(table.columns), []
    for name in (n for n in ANGLES if n in columns and (revolute or n != "position")):
        if (one := unwrapped(name, table.time, columns[name], columns.get("velocity"))) is not None:
            columns[name] = one.near(0.0)
            said.append(one.said)
    return replace(table, columns=columns, said=(*table.said, *said)) if said else table


def unwrapped(name: str, time: np.ndarray, values: np.ndarray, velocity: np.ndarray | None = None) -> Continuous | None:
    """Return a reading with whole periods added where it wraps; None where it does not.

    Parameters
    ----------
    name
        Of its column, to say so.
    time, values, velocity : ndarray, shape (n,)
        NaN where a sample is missing.
    """
    known = np.flatnonzero(np.isfinite(values) & np.isfinite(time))
    if len(known) < FEWEST:
        return None
    x, t = values[known], time[known]
    steps, times = np.diff(x), np.diff(t)
    is_jump = np.abs(steps) > 0.5 * np.ptp(x)
    if not is_jump.any() or not (times > 0.0).all():
        return None
    before = _expected(steps, times, is_jump)
    limit = _usual_bend(steps, times, is_jump, x)
    period, words = _period(x, np.abs(steps - before)[is_jump], limit)
    if not limit <= COARSE * period:
        return None
    turns = np.rint((before - steps) / period) * is_jump
    whole = steps + period * turns
    bends = np.abs(np.diff(whole / times) * times[1:])
    at_jump = is_jump[1:] | is_jump[:-1]
    is_wrap = np.abs(turns[is_jump]).min() == 1.0 == np.abs(turns).max() and np.ptp(x) <= period + limit
    if not is_wrap or bends[at_jump].max() > limit:
        return None
    agrees = velocity is not None and _agrees(velocity[known], whole, times, is_jump, period)
    out = values.copy()
    out[known[1:]] += period * np.cumsum(turns)
    count = int(is_jump.sum())
    more = ", which velocity confirms" if agrees else ""
    where = f"{count} samples" if count > 1 else "a sample"
    return Continuous(out, period, f"{name} jumps by {words} at {where}: unwrapped{more}")


def _expected(steps: np.ndarray, times: np.ndarray, is_jump: np.ndarray) -> np.ndarray:
    """Return the step of the mean speed of the steps around it, shape (n - 1,)."""
    speeds, known = steps / times, np.flatnonzero(~is_jump)
    return np.asarray(np.interp(np.arange(len(steps)), known, speeds[known]) * times)


def _usual_bend(steps: np.ndarray, times: np.ndarray, is_jump: np.ndarray, x: np.ndarray) -> float:
    """Return the largest second difference that a jump may leave: see `TIMES`, and two counts."""
    bends = np.abs(np.diff(steps / times) * times[1:])[~(is_jump[1:] | is_jump[:-1])]
    return TIMES * float(np.quantile(bends, USUAL)) + 2.0 * _count(x) if len(bends) else math.inf


def _count(x: np.ndarray) -> float:
    """Return the size of one count of a reading, also of a motion that passes many; 0 where it is not in counts."""
    return count_of(x) or float((x == np.rint(x)).all())


def _period(x: np.ndarray, sizes: np.ndarray, limit: float) -> tuple[float, str]:
    """Return the period of jumps of these sizes, and it in words; 0 where they have none."""
    size = float(np.median(sizes))
    if turn := next((p for p in TURNS if abs(size - p) <= limit), None):
        return turn, TURNS[turn]
    if not (count := _count(x)):
        return 0.0, ""
    bits = 2.0 ** round(math.log2(size / count))
    if bits >= SHORTEST_COUNTER and abs(size - bits * count) <= limit:
        return bits * count, f"{bits:.0f} counts"
    rounds = (m * float(np.rint(size / count / m)) for m in ROUND)
    whole = next(n for n in rounds if abs(size - n * count) <= max(limit, count))
    visited = np.histogram(x, EIGHTHS)[0].min() > 0
    return (whole * count, f"{whole:.0f} counts") if visited and whole >= SHORTEST_COUNTER else (0.0, "")


def _agrees(velocity: np.ndarray, whole: np.ndarray, times: np.ndarray, is_jump: np.ndarray, period: float) -> bool:
    """Return whether a velocity says the steps, those at the jumps too."""
    said = 0.5 * (velocity[1:] + velocity[:-1]) * times
    known, rest = ~is_jump & np.isfinite(said), said[~is_jump & np.isfinite(said)]
    gain = float(rest @ whole[known]) / max(float(rest @ rest), 1e-300)
    missed = whole - gain * said
    if not float(np.mean(missed[known] ** 2)) < FOLLOWS * float(np.mean(whole[known] ** 2)):
        return False
    return bool((np.abs(missed[is_jump & np.isfinite(said)]) < COARSE * period).all())
