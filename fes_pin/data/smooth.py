"""Measured signals made smooth without delay: a zero-phase low pass, and splines whose bandwidth the data set."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.interpolate import make_interp_spline, make_lsq_spline, make_smoothing_spline
from scipy.signal import butter, sosfiltfilt

from fes_pin.data.errors import InputError

CUTOFF_HZ = 6.0
"""Walking's markers are low-passed here: D. A. Winter, "Biomechanics and Motor Control of Human Movement", ch. 3."""
ORDER = 2
"""Of the Butterworth filter, which runs forwards and backwards."""
DEGREE = 5
"""Of the splines of an imposed motion: their acceleration is smooth."""
KNOT_COUNTS = 30
"""How many numbers of knots are tried, from one to a quarter of the samples."""
_WINDOW = 300
"""Samples that cross-validation looks at together: its cost grows with the cube."""
_GRID = 10.0 ** np.linspace(-4.0, 8.0, 121)
"""Lambdas that are tried, in samples to the fourth."""
_TWICE = (2.0**0.5 - 1.0) ** (1.0 / (2 * ORDER))
"""Run twice, the filter halves the power lower than run once; the design is higher by this (Winter, ch. 3)."""


def low_pass(values: np.ndarray, dt: float, cutoff_hz: float = CUTOFF_HZ) -> np.ndarray:
    """Zero-phase Butterworth low pass along the first axis: half of the power passes at the cut-off.

    Where the cut-off is above nine tenths of half the sample rate there is nothing to take away.

    Parameters
    ----------
    values
        (n, ...).
    dt
        Time step, s.
    cutoff_hz
        Hz.

    Raises
    ------
    InputError
        The cut-off is not positive, or the record is shorter than the filter needs.
    """
    if not cutoff_hz > 0.0:
        raise InputError(f"a cut-off must be positive, got {cutoff_hz} Hz", column="cutoff_hz")
    design = cutoff_hz / _TWICE
    if design >= 0.45 / dt:
        return np.array(values, dtype=float)
    reach = int(np.ceil(1.0 / (cutoff_hz * dt)))
    if len(values) <= reach:
        raise InputError(
            f"{len(values)} samples are too few for a low pass of {cutoff_hz:g} Hz; {reach + 1} are needed"
        )
    return sosfiltfilt(butter(ORDER, design, fs=1.0 / dt, output="sos"), values, axis=0, padlen=reach)


def rates(values: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and second derivative by quintic splines through the samples: two arrays (n, ...)."""
    spline = make_interp_spline(time, values, k=5)
    return spline(time, 1), spline(time, 2)


def smoothing_spline(values: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Cubic smoothing splines by generalized cross-validation, with the bandwidth that it found.

    Cross-validation takes the noise for white; on signals that were filtered before it finds too much bandwidth.

    Parameters
    ----------
    values
        (n, m).
    time
        (n,) s, in equal steps.

    Returns
    -------
    smooth, rate, acceleration
        (n, m) each; the acceleration of a natural spline is 0 at both ends.
    bandwidth_hz
        (m,) where half of the amplitude passes: 1 / (2 pi (lambda dt)^(1/4)).
    """
    dt = float(time[-1] - time[0]) / (len(time) - 1)
    out = np.empty((3, *values.shape))
    bandwidth = np.empty(values.shape[1])
    count = np.arange(len(time), dtype=float)  # in samples: the solver's scale
    for k, column in enumerate(values.T):
        lam = _cross_validated(column)
        spline = make_smoothing_spline(count, column, lam=lam)
        for order in range(3):
            out[order, :, k] = spline(count, order) / dt**order
        bandwidth[k] = 1.0 / (2.0 * np.pi * dt * lam**0.25) if lam > 0.0 else 0.5 / dt
    return out[0], out[1], out[2], np.minimum(bandwidth, 0.5 / dt)


def smoothed_rates(values: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Position, velocity and acceleration of a reading, by the quintic spline on equal knots that the data allow.

    What follows a position best is too rough by far for its acceleration where it lets a little of all frequencies
    through, as a spline with a penalty does; one with few knots passes nothing beyond them, and has no bend of its own
    at the ends. How many knots it has is set by generalized cross-validation, in which each counts 1.4 times, as chance
    has it too rough otherwise (Kim and Gu 2004, J. R. Stat. Soc. B 66:337).

    Parameters
    ----------
    values, time
        (n,), the time in equal steps.

    Returns
    -------
    derivatives
        (3, n).
    doubt
        (3,): standard deviations of white noise in them, s^2 2 f dt (2 pi f)^2k / (2 k + 1) the variances, with s that
        of a sample and f the bandwidth.
    bandwidth_hz
        f: half the knots' rate, beyond which nothing passes.
    """
    n, dt = len(time), float(time[-1] - time[0]) / (len(time) - 1)
    if n < 2 * (DEGREE + 1):
        rate = np.gradient(values, dt)
        return np.stack([values, rate, np.gradient(rate, dt)]), np.full(3, np.nan), 0.5 / dt
    best = (np.inf, 0.0, 0, None)
    for inner in np.unique(np.round(np.geomspace(1, max(n // 4, 1), KNOT_COUNTS)).astype(int)):
        ends, knots = np.full(DEGREE + 1, time[0]), np.linspace(time[0], time[-1], inner + 2)[1:-1]
        used = inner + DEGREE + 1
        if used >= 0.6 * n:
            continue
        spline = make_lsq_spline(time, values, np.r_[ends, knots, np.full(DEGREE + 1, time[-1])], k=DEGREE)
        left = float(np.sum((values - spline(time)) ** 2))
        score = left / (1.0 - 1.4 * used / n) ** 2
        if score < best[0]:
            best = (score, float(np.sqrt(left / (n - used))), inner, spline)
    _, noise, inner, spline = best
    bandwidth = 0.5 * (inner + 1) / float(time[-1] - time[0])
    doubt = [2.0 * bandwidth * dt * (2.0 * np.pi * bandwidth) ** (2 * k) / (2 * k + 1) for k in range(3)]
    assert spline is not None
    return np.stack([spline(time, k) for k in range(3)]), noise * np.sqrt(doubt), bandwidth


def _cross_validated(values: np.ndarray) -> float:
    """Lambda of least generalized cross-validation, by Whittaker's smoother, the spline's counterpart for equal steps.

    Its penalty is on second differences (Eilers 2003, Anal. Chem. 75:3631); a long record is judged window by window.
    """
    penalty, power, _ = _spectrum(values)
    kept = 1.0 / (1.0 + _GRID[:, None] * penalty)
    score = ((1.0 - kept) ** 2 @ power) / np.maximum(1.0 - kept.mean(axis=1), 1e-9) ** 2
    return float(_GRID[int(np.argmin(score))])


def _spectrum(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Penalties of the smoother's components, their squares summed over windows, and how many windows there are."""
    size = min(len(values), _WINDOW)
    count = len(values) // size
    windows = values[: size * count].reshape(count, size)
    penalty, vectors = _second_differences(size)
    return penalty, ((windows @ vectors) ** 2).sum(axis=0), count


@lru_cache(maxsize=4)
def _second_differences(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues and eigenvectors of the penalty on second differences of `size` samples."""
    difference = np.diff(np.eye(size), 2, axis=0)
    values, vectors = np.linalg.eigh(difference.T @ difference)
    return np.maximum(values, 0.0), vectors
