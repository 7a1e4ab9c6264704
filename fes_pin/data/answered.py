"""Prediction of a controller's effort from its readings: the residual is the noise that the effort was recorded with.

A controller computes an effort from its present and past readings. As long as its law does not change, the effort is a
linear function of each reading y, of its last difference, and of its difference to low passes P_i of it, with time
constants of 1, 2, 4, 8 ... samples, which represent filtered rates and integrals. The reference enters as a constant
and a trend:

    u_k = a + b k + c y_k + d (y_k - y_(k-1)) + sum e_i (y_k - P_i y_k)

A trial is cut into short stretches, and neighbours are joined while they have the same coefficients (Chow's test). The
noise of the recorded effort is in no reading of the rig: over a long stretch the prediction is the effort that acted.

Source: Chow, Tests of equality between sets of coefficients in two linear regressions, Econometrica 28 (1960).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.special import fdtrc

LOW_PASSES = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
"""Time constants of the low passes, in samples: between two of them a filter is nearly a mean of both."""
SHORTEST = 4
"""Least samples of a stretch for each coefficient: enough to estimate the residual's size within a tenth or two."""
APART_LEVEL = 0.01
"""Level at which two stretches differ: one too many costs a few samples, one too few mixes two laws."""
JUMP = 5.0
"""Standard deviations above which a difference is a jump, not noise."""


@dataclass(frozen=True)
class ControllerAnswer:
    """The effort that a controller computes from its readings.

    Attributes
    ----------
    values
        Shape (n,), the effort as the readings predict it.
    left_std
        Shape (n,), standard deviation of the residual of the effort, over the stretch about each sample.
    gains
        Shape (n, readings, 2), its derivatives by each reading at the same sample and at the sample before.
    """

    values: np.ndarray
    left_std: np.ndarray
    gains: np.ndarray

    def quieted(self, effort: np.ndarray, noise: float) -> np.ndarray:
        """Return the estimate of the effort that acted, shape (n,), from a recorded one with noise of this deviation.

        The residual, of variance s^2, is noise and effort that the readings do not predict. The effort is a share
        1 - noise^2 / s^2 of the residual, as in Wiener's filter.
        """
        all_noise = np.ones_like(self.left_std)
        of_left = np.divide(noise, self.left_std, out=all_noise, where=self.left_std > noise)
        return np.asarray(self.values + (1.0 - of_left**2) * (effort - self.values))


def answer_of(effort: np.ndarray, readings: Sequence[np.ndarray]) -> ControllerAnswer:
    """Predict an effort from readings.

    Parameters
    ----------
    effort
        Shape (n,).
    readings
        Each of shape (n,); NaN where nothing was read.
    """
    columns, moved = _columns(readings, len(effort))
    values, left = effort.copy(), np.zeros(len(effort))
    gains = np.zeros((len(effort), *moved.shape[1:]))
    for begin, end, triangle in _stretches(np.column_stack([columns, effort])):
        solved = np.linalg.lstsq(triangle[:-1, :-1], triangle[:-1, -1], rcond=1e-9)[0]
        values[begin:end] = columns[begin:end] @ solved
        left[begin:end] = np.sqrt(_missed(triangle) / max(end - begin - columns.shape[1], 1))
        gains[begin:end] = np.tensordot(solved, moved, 1)
    return ControllerAnswer(values, left, gains)


def without_jumps(x: np.ndarray) -> np.ndarray:
    """Return differences clipped at `JUMP` robust standard deviations: a jump of the reference is no noise."""
    x = np.where(np.isfinite(x), x, 0.0)
    size = np.abs(x[x != 0.0])  # an encoder at rest, or a held sample, has no noise
    most = JUMP * 1.4826 * float(np.median(size)) if len(size) else 0.0
    return np.clip(x, -most, most)


def _columns(readings: Sequence[np.ndarray], n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the regressors of an effort, each scaled to a deviation of 1, shape (n, coefficients).

    The second array has their derivatives by each reading at the same sample and at the one before, shape
    (coefficients, readings, 2).
    """
    from scipy.signal import lfilter  # noqa: PLC0415 - half a second, for rigs that a controller drives

    out, kept = [np.ones(n), np.linspace(-1.0, 1.0, n)], np.exp(-1.0 / np.array(LOW_PASSES))
    felt = np.column_stack([np.r_[1.0, 1.0, kept], np.r_[0.0, -1.0, kept * (kept - 1.0)]])
    moved = [np.zeros((len(out), len(readings), 2))]
    for k, reading in enumerate(readings):
        seen = np.isfinite(reading)
        if not seen.any():
            continue
        y = np.interp(np.arange(n), np.flatnonzero(seen), reading[seen])
        y = y - y.mean()
        apart = [y, np.diff(y, prepend=y[0])]
        apart += [y - lfilter([1.0 - one], [1.0, -one], y, zi=[one * y[0]])[0] for one in kept]
        sizes = [max(float(one.std()), 1e-300) for one in apart]
        out += [one / size for one, size in zip(apart, sizes, strict=True)]
        own = np.zeros((len(apart), len(readings), 2))
        own[:, k] = felt / np.array(sizes)[:, None]
        moved.append(own)
    return np.stack(out, axis=1), np.concatenate(moved)


def _stretches(rows: np.ndarray) -> Iterator[tuple[int, int, np.ndarray]]:
    """Yield stretches with the same coefficients: first sample, end, and the triangle R of the QR of its rows."""
    width = rows.shape[1] - 1
    ends = np.linspace(0, len(rows), max(1, len(rows) // (SHORTEST * width)) + 1).astype(int)
    begin, now = 0, _triangle(rows[: ends[1]])
    for first, last in pairwise(ends[1:]):
        following = _triangle(rows[first:last])
        both = _triangle(np.vstack([now, following]))
        if _differ(_missed(now) + _missed(following), _missed(both), width, int(last) - begin):
            yield begin, int(first), now
            begin, now = int(first), following
        else:
            now = both
    yield begin, len(rows), now


def _triangle(rows: np.ndarray) -> np.ndarray:
    """Return R of the QR of rows, square: with rows of zeros where there are fewer rows than columns."""
    missing = np.zeros((max(0, rows.shape[1] - len(rows)), rows.shape[1]))
    return np.asarray(np.linalg.qr(np.vstack([rows, missing]), mode="r"))


def _missed(triangle: np.ndarray) -> float:
    """Return the residual sum of squares of the last column's regression on the others."""
    return float(triangle[-1, -1] ** 2)


def _differ(apart: float, together: float, width: int, n: int) -> bool:
    """Return the result of Chow's test, from the residual sums of squares apart and together."""
    under = n - 2 * width
    if under < 1 or not together > apart:
        return False
    return bool(fdtrc(width, under, (together - apart) / width / max(apart / under, 1e-300)) < APART_LEVEL)
