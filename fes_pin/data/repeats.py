"""What an imposed motion repeats, a passive limb repeats: effort that differs between equal cycles is no mechanism.

A dynamometer moves a limb to and fro. Springs, damping, friction, weight and inertia answer each equal cycle alike; a
subject who does not relax does not. The test needs cycles of one shape. It says nothing of an effort that is constant,
or that a reflex repeats with the motion.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fes_pin.data.imposed import imposed_motion
from fes_pin.data.schema import IMPOSED, RigSchema
from fes_pin.data.trial import Trial

BINS = 16
"""Parts of a cycle whose mean efforts are compared: noise that is faster averages out."""
FEWEST = 4
"""Equal cycles that show a scatter about a trend: two more than the trend takes."""
SAME = 0.03
"""Share of its range by which the motion of equal cycles differs, root mean square; and of their length."""
SHARE = 0.15
"""Share of the effort's deviation over a cycle from which a scatter between cycles is no mechanism. Motion that differs
by `SAME` gives as much of a spring's effort, and twice that of an inertia's."""
ABOVE_NOISE = 3.0
"""How many times the scatter that white noise leaves it must be."""


@dataclass(frozen=True)
class Unrepeated:
    """Effort of a trial that equal cycles of its motion do not share.

    Attributes
    ----------
    size
        Its standard deviation, in the unit of the effort.
    share
        The same, over the standard deviation of the effort over a cycle.
    cycles
        How many equal cycles were compared.
    noise
        The standard deviation that white noise leaves of a mean over a part of a cycle.
    """

    size: float
    share: float
    cycles: int
    noise: float

    @property
    def is_no_mechanism(self) -> bool:
        """Whether passive parts would have to differ from cycle to cycle."""
        return self.share > SHARE and self.size > ABOVE_NOISE * self.noise


def effort_of_repeats(trial: Trial, schema: RigSchema, left: np.ndarray | None = None) -> Unrepeated | None:
    """Compare the effort of a trial between equal cycles of its motion, without a trend from cycle to cycle.

    The first cycle is left out: a limb that was still relaxes in it.

    Parameters
    ----------
    left
        What a model leaves of the effort, shape (n,), to be compared in its place. Shares are of the effort.

    Returns
    -------
    Unrepeated, or None of a trial without enough equal cycles, or whose motion is not imposed
    """
    name = schema.outputs.get(IMPOSED, "")
    if trial.kind != IMPOSED or name not in trial:
        return None
    position = imposed_motion(trial, schema.imposed).values[0]
    ends = _upward(position)[1:]
    if len(ends) <= FEWEST:
        return None
    length = np.diff(ends)
    usual = float(np.median(length))
    if usual < 2 * BINS:
        return None
    moved, effort = (_binned(values, ends) for values in (position, trial[name]))
    odd = effort if left is None else _binned(left, ends)
    apart = np.sqrt(np.mean((moved - np.median(moved, axis=0)) ** 2, axis=1)) / max(float(np.ptp(position)), 1e-300)
    equal = (apart < SAME) & (np.abs(length - usual) < SAME * usual + 1.0) & np.isfinite(effort + odd).all(axis=1)
    if np.count_nonzero(equal) < FEWEST:
        return None
    count, rows = int(np.count_nonzero(equal)), odd[equal]
    trend = np.column_stack([np.ones(count), ends[:-1][equal] - ends[0]])
    left = rows - trend @ np.linalg.lstsq(trend, rows, rcond=None)[0]
    size = float(np.sqrt(np.sum(left**2) / (BINS * (count - trend.shape[1]))))
    white = float(np.nanstd(np.diff(trial[name], 3))) / np.sqrt(20.0)
    spread = float(np.std(effort[equal]))
    return Unrepeated(size, size / max(spread, 1e-300), count, white / np.sqrt(usual / BINS))


def _upward(values: np.ndarray) -> np.ndarray:
    """Samples at which a motion crosses its middle upwards, once in each swing of half its range."""
    low, high = np.quantile(values, (0.02, 0.98))
    middle, quarter = 0.5 * (low + high), 0.25 * (high - low)
    state = np.where(values > middle + quarter, 1, np.where(values < middle - quarter, -1, 0))
    turns = np.flatnonzero(state)
    up = [k for k, j in pairwise(turns) if state[k] < 0 < state[j]]
    return np.array([k + int(np.argmax(values[k:] >= middle)) for k in up], dtype=int)


def _binned(values: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Means over parts of each cycle, shape (cycles, BINS); NaN of a cycle with samples that were not measured."""
    total = np.concatenate([[0.0], np.cumsum(np.nan_to_num(values))])
    edges = np.stack([np.linspace(a, b, BINS + 1) for a, b in pairwise(ends)])
    means = np.diff(np.interp(edges, np.arange(len(total)), total), axis=1) / np.diff(edges, axis=1)
    means[[not np.isfinite(values[a:b]).all() for a, b in pairwise(ends)]] = np.nan
    return means
