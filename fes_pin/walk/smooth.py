"""Measured signals made smooth without delay: a zero-phase low pass, and splines whose bandwidth the data set."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.interpolate import make_interp_spline, make_smoothing_spline
from scipy.signal import butter, sosfiltfilt

from fes_pin.data.errors import InputError

CUTOFF_HZ = 6.0
"""Walking's markers are low-passed here: D. A. Winter, "Biomechanics and Motor Control of Human Movement", ch. 3."""
ORDER = 2
"""Of the Butterworth filter, which runs forwards and backwards."""
_WINDOW = 300
"""Samples that cross-validation looks at together: its cost grows with the cube."""
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


def _cross_validated(values: np.ndarray) -> float:
    """Lambda of least generalized cross-validation, by Whittaker's smoother, the spline's counterpart for equal steps.

    Its penalty is on second differences (Eilers 2003, Anal. Chem. 75:3631); a long record is judged window by window.
    """
    size = min(len(values), _WINDOW)
    count = len(values) // size
    windows = values[: size * count].reshape(count, size)
    penalty, vectors = _second_differences(size)
    power = ((windows @ vectors) ** 2).sum(axis=0)
    grid = 10.0 ** np.linspace(-4.0, 8.0, 121)
    kept = 1.0 / (1.0 + grid[:, None] * penalty)
    score = ((1.0 - kept) ** 2 @ power) / np.maximum(1.0 - kept.mean(axis=1), 1e-9) ** 2
    return float(grid[int(np.argmin(score))])


@lru_cache(maxsize=4)
def _second_differences(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues and eigenvectors of the penalty on second differences of `size` samples."""
    difference = np.diff(np.eye(size), 2, axis=0)
    values, vectors = np.linalg.eigh(difference.T @ difference)
    return np.maximum(values, 0.0), vectors
