"""Spectra of recorded signals, and what of them is motion."""

from collections.abc import Sequence

import numpy as np

SEGMENT_S = 4.0
"""Segments of a spectrum, s: they resolve a quarter of a hertz."""
QUIET = 0.7
"""Share of the Nyquist frequency above which a reading is noise."""
ABOVE_NOISE = 4.0
"""Ratio of spectra at which a motion is above the noise: spectra of a few segments scatter by a half."""
OF_POWER, TIMES = 0.98, 4.0
"""Share of the power of the velocity that a motion has below a frequency, and its band in units of that frequency."""
SLOWEST_HZ = 3.0
"""Least band of a motion, Hz: limbs and laboratory joints under control move below."""


def spectrum(values: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies, Hz, and the one-sided power of a signal, its unit squared per Hz, shape (f,) each.

    Source: Welch, The use of fast Fourier transform for the estimation of power spectra, IEEE Trans. AU-15 (1967).

    Parameters
    ----------
    values
        Shape (n,).
    dt
        Time step, s.
    """
    length = min(len(values), max(1, round(SEGMENT_S / dt)))  # a slower log has one sample a segment
    window = np.hanning(length + 2)[1:-1]
    starts = range(0, len(values) - length + 1, max(1, length // 2))
    pieces = np.array([values[k : k + length] - values[k : k + length].mean() for k in starts]) * window
    power = np.mean(np.abs(np.fft.rfft(pieces, axis=1)) ** 2, axis=0) * 2.0 * dt / float(window @ window)
    return np.fft.rfftfreq(length, dt), power


def pooled(signals: Sequence[tuple[np.ndarray, float]], grid: np.ndarray) -> np.ndarray:
    """Return the mean spectrum of signals at frequencies, each weighed by its length, shape (f,).

    Parameters
    ----------
    signals
        Values and time step, s, of each.
    """
    each = [np.interp(grid, *spectrum(values, dt)) for values, dt in signals]
    return np.asarray(np.average(each, axis=0, weights=[len(values) for values, _ in signals]))
