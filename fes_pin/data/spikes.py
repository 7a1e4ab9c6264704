"""Spikes: samples far off their neighbours on both sides, as a loose plug or a lost packet makes them.

A sample (or two in a row) is a spike if it leaves the cubic through two neighbours on either side by `FAR` deviations,
and the straight lines through three neighbours before and after it, continued, by `OFF_LINE` to the same side; and if
those lines are nearer each other than the sample. A step, the kink of a contact, the onset of a stimulus and a twitch
lie near the line of one side; hum, vibration and pulses are in the deviation, which is the robust one of the
surroundings. In white noise of deviation 1 a spike must be about 9 high.
"""

from collections.abc import Sequence

import numpy as np

from fes_pin.data.trial import Trial

FAR = 6.0
"""Deviations: among 20 000 Gaussian samples the chance of one beyond is 4e-5."""
OFF_LINE = 4.5
"""Deviations from the lines: where a signal bends or jumps it lies on one of them, but for 7e-6 of the noise."""
MAD_TO_STD = 1.4826
"""Standard deviation over median absolute deviation of a Gaussian."""
AROUND = 100
"""Samples to either side from which the size of deviations is estimated."""
MOST = 0.05
"""Share of a channel above which excursions belong to the signal."""
LONGEST = 2
"""Samples in a row that are still a spike."""
PASSES = 4
"""A spike next to a spike shows when the first is gone."""
CUBIC, LINE, AFTER = 2, 3, 8
"""Neighbours on a side that the cubic, the straight line, and the parabola at an end go through."""


def without_spikes(trial: Trial, columns: Sequence[str]) -> tuple[Trial, dict[str, tuple[int, ...]]]:
    """A trial with the spikes of measured columns replaced by what their neighbours say.

    Returns
    -------
    Trial
        The same object where there are none.
    dict
        Indices of the samples replaced, by column.
    """
    found, changed = {}, {}
    for name in columns:
        if name in trial:
            values, mask = despiked(trial[name])
            if mask.any():
                changed[name], found[name] = values, tuple(int(k) for k in np.flatnonzero(mask))
    return (trial.with_columns(**changed) if changed else trial), found


def despiked(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values with spikes replaced, and where they were; both of shape (n,)."""
    out, mask = np.array(values, dtype=float), np.zeros(len(values), dtype=bool)
    for _ in range(PASSES):
        new = np.zeros_like(mask)
        for length in range(1, LONGEST + 1):
            if len(out) > 2 * (LINE + length):
                new |= _spikes(out, length)
        new |= _first_spikes(out) | _first_spikes(out[::-1])[::-1]
        if not new.any():
            break
        mask |= new
        out = _interpolated(values, mask)
    if mask.mean() > MOST:
        return np.array(values, dtype=float), np.zeros_like(mask)
    return out, mask


def _spikes(x: np.ndarray, length: int) -> np.ndarray:
    """Where `length` samples in a row stand off, shape (n,)."""
    count = len(x) - 2 * LINE - length + 1
    sides = [x[k : k + count] for k in range(LINE)] + [x[LINE + length + k :][:count] for k in range(LINE)]
    at = np.r_[np.arange(LINE), LINE + length + np.arange(LINE)].astype(float)
    mask, hit, off, off_line = np.zeros(len(x), dtype=bool), np.ones(count, dtype=bool), [], []
    for inside in range(LINE, LINE + length):
        middle = slice(LINE - CUBIC, LINE + CUBIC)
        weights = [_weights(at[middle], inside, 3), _weights(at[:LINE], inside, 1), _weights(at[LINE:], inside, 1)]
        sample = x[inside : inside + count]
        parts = zip(weights, (sides[middle], sides[:LINE], sides[LINE:]), strict=True)
        here, before, after = (sample - sum(w * s for w, s in zip(*p, strict=True)) for p in parts)
        hit &= np.sign(here) * np.sign(before) > 0
        hit &= np.sign(here) * np.sign(after) > 0
        hit &= np.abs(before - after) < np.minimum(np.abs(before), np.abs(after))
        off.append(np.abs(here))
        off_line.append(np.minimum(np.abs(before), np.abs(after)))
        if inside == LINE:
            line = np.abs(before)
    least, floor = np.min(off, axis=0), _quantum(x)
    hit &= least > FAR * max(_deviation(off[0]), floor)
    for k in np.flatnonzero(hit):
        near = slice(max(0, k - AROUND), k + AROUND + 1)
        far = least[k] > FAR * _deviation(off[0][near])
        if far and min(b[k] for b in off_line) > OFF_LINE * max(_deviation(line[near]), floor):
            mask[k + LINE : k + LINE + length] = True
    return mask


def _deviation(absolute: np.ndarray) -> float:
    return MAD_TO_STD * float(np.median(absolute))


def _first_spikes(x: np.ndarray) -> np.ndarray:
    """The same of the first samples, which have neighbours on one side alone: off the parabola through those after.

    A sample is no spike where it is nearer the straight line or the parabola through the nearest samples than these are
    to each other: the signal bends there.
    """
    mask = np.zeros(len(x), dtype=bool)
    if len(x) < AROUND:
        return mask
    weights = _weights(np.arange(1.0, AFTER + 1), 0.0, 2)
    rows = np.lib.stride_tricks.sliding_window_view(x, AFTER + 1)
    off = np.abs(rows[:, 0] - rows[:, 1:] @ weights)
    line, bent = (rows[:, 0] - rows[:, 1 : LINE + 1] @ _weights(np.arange(1.0, LINE + 1), 0.0, d) for d in (1, 2))
    agree = np.abs(line - bent) < np.minimum(np.abs(line), np.abs(bent))
    for k in np.flatnonzero(agree[:LINE]):
        scale = max(_deviation(off), _deviation(off[: k + AROUND]), _quantum(x))
        mask[k] = off[k] > FAR * scale and off[k] > 2.0 * off[LINE:AROUND].max()
    return mask


def _weights(at: np.ndarray, to: float, degree: int) -> np.ndarray:
    """Weights with which values at some places give the value at another of a least-squares polynomial."""
    return np.linalg.pinv(np.vander(at - to, degree + 1))[-1]


def _quantum(x: np.ndarray) -> float:
    """Least difference between two values: the step of a coarse encoder."""
    steps = np.diff(np.unique(x))
    return max(float(steps.min(initial=np.inf)) if len(steps) else 0.0, 1e-5 * float(np.ptp(x)))


def _interpolated(values: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Values with those in the mask on a polynomial through the three nearest good ones to either side."""
    out, good = np.array(values, dtype=float), np.flatnonzero(~mask)
    for k in np.flatnonzero(mask):
        middle = np.searchsorted(good, k)
        near = good[max(0, middle - LINE) : middle + LINE]
        out[k] = _weights(near.astype(float), float(k), min(3, len(near) - 1)) @ values[near]
    return out
