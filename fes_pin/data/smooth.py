"""Measured signals made smooth without delay: a zero-phase low pass, and splines whose bandwidth the data set."""

from functools import lru_cache

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline, make_lsq_spline
from scipy.signal import butter, sosfiltfilt

from fes_pin.data.errors import InputError

CUTOFF_HZ = 6.0
"""Walking's markers are low-passed here: D. A. Winter, "Biomechanics and Motor Control of Human Movement", ch. 3."""
ORDER = 2
"""Of the Butterworth filter, which runs forwards and backwards."""
DEGREE = 5
"""Of the splines of an imposed motion: their acceleration is smooth."""
KNOT_COUNTS = 30
"""How many numbers of knots are tried, from one to a quarter of the samples; to half of those that are taken apart."""
APART = (16, 12, 8, 6, 4, 3, 2)
"""Samples that knots are counted with besides are so far apart: the farthest that sample the motion well."""
TURNS = 4
"""Sequences of such samples that are looked at together, at most."""
WELL = 0.3
"""Knots for each sample at most where samples show a motion well; cross-validation ends at twice as many."""
FEWER = 0.6
"""Share of knots beneath which noise is not white: with white noise their number scatters by a quarter."""
MOTION, PLACES = 5.0, 5.0
"""Bounds on residuals with few knots, beyond which they hold motion: the ratio of their squares to those with many
knots, which follow a part of correlated noise; and the number of places between knots, or a quarter of them, over which
noise spreads its squares evenly. A quick release leaves a ratio of 20 to 100, or all squares in two or three places."""
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
        few = f"{len(values)} samples are too few for a low pass of {cutoff_hz:g} Hz"
        raise InputError(f"{few}; {reach + 1} are needed")
    return sosfiltfilt(_butterworth(design * dt), values, axis=0, padlen=reach)


@lru_cache(maxsize=64)
def _butterworth(cutoff: float) -> np.ndarray:
    """Second-order sections of the filter, from its cut-off in units of the sampling rate."""
    return np.asarray(butter(ORDER, cutoff, fs=1.0, output="sos"))


def rates(values: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and second derivative by quintic splines through the samples: two arrays (n, ...)."""
    spline = make_interp_spline(time, values, k=5)
    return spline(time, 1), spline(time, 2)


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
    std
        (3,): standard deviations of white noise in them, s^2 2 f dt (2 pi f)^2k / (2 k + 1) the variances, with s that
        of a sample and f the bandwidth.
    bandwidth_hz
        f: half the knots' rate, beyond which nothing passes.
    """
    n, dt = len(time), float(time[-1] - time[0]) / (len(time) - 1)
    if n < 2 * (DEGREE + 1):
        rate = np.gradient(values, dt)
        return np.stack([values, rate, np.gradient(rate, dt)]), np.full(3, np.nan), 0.5 / dt
    inner, apart = _knots(values, time)
    spline = _spline(time, values, _knot_places(time, inner))
    noise = float(np.sqrt(np.sum((values - spline(time)) ** 2) / (n - inner - DEGREE - 1)))
    bandwidth = 0.5 * (inner + 1) / float(time[-1] - time[0])
    variances = [2.0 * bandwidth * apart * dt * (2.0 * np.pi * bandwidth) ** (2 * k) / (2 * k + 1) for k in range(3)]
    return np.stack([spline(time, k) for k in range(3)]), noise * np.sqrt(variances), bandwidth


def _knots(values: np.ndarray, time: np.ndarray) -> tuple[int, int]:
    """How many inner knots a reading has, and how many samples apart its noise is taken for white.

    Noise with a correlation time of some samples, of an interpolated log or of a clock that drifts between them, is
    followed by a spline as motion is, and then an acceleration is mostly noise. Samples so far apart that they just
    show the motion well do not share such noise. White noise lets them have fewer knots by the power of 1 / 13 of the
    distance alone (Wahba 1990, Spline Models for Observational Data, section 4.4, for a quintic).
    """
    all_of_them = _cross_validated_knots(values, time, 1)
    for apart in APART:
        few = _cross_validated_knots(values, time, apart)
        if few <= WELL * len(time) / apart:
            usual = round(few * apart ** (1.0 / 13.0))
            correlated = usual < FEWER * all_of_them and _leave_noise(values, time, usual, all_of_them)
            return (usual, apart) if correlated else (all_of_them, 1)
    return all_of_them, 1


def _leave_noise(values: np.ndarray, time: np.ndarray, few: int, many: int) -> bool:
    """True if what few knots leave is noise: little more than many knots leave, and not in a few places alone."""
    left = _left(values, time, few)
    squares = np.array([float(part @ part) for part in np.array_split(left, few + 1)])
    places = squares.sum() ** 2 / np.sum(squares**2) if squares.any() else 0.0
    return bool(places > min(PLACES, 0.25 * len(squares)) and left.std() < MOTION * _left(values, time, many).std())


def _left(values: np.ndarray, time: np.ndarray, inner: int) -> np.ndarray:
    """What a spline with so many inner knots leaves."""
    return np.asarray(values - _spline(time, values, _knot_places(time, inner))(time))


def _cross_validated_knots(values: np.ndarray, time: np.ndarray, apart: int) -> int:
    """The number of inner knots of least generalized cross-validation, by samples so far apart, in turns."""
    turns = [slice(k, None, apart) for k in range(0, apart, -(-apart // TURNS))]
    best, most = (np.inf, 1), max(len(time) // (4 if apart == 1 else 2 * apart), 1)
    for inner in np.unique(np.round(np.geomspace(1, most, KNOT_COUNTS)).astype(int)):
        used, knots, score = inner + DEGREE + 1, _knot_places(time, inner), 0.0
        for own in turns:
            x, y = time[own], values[own]
            if used >= 0.6 * len(x):
                return best[1]
            left = y - _spline(x, y, knots)(x)
            score += float(left @ left) / (1.0 - 1.4 * used / len(x)) ** 2
        best = min(best, (score, int(inner)))
    return best[1]


def _spline(time: np.ndarray, values: np.ndarray, knots: np.ndarray) -> BSpline:
    """By the normal equations: with equal knots they are well posed, and a fourth of the work."""
    return make_lsq_spline(time, values, knots, k=DEGREE, method="norm-eq")


def _knot_places(time: np.ndarray, inner: int) -> np.ndarray:
    """Knots in equal steps, with as many at each end as a spline of this degree needs."""
    return np.pad(np.linspace(time[0], time[-1], inner + 2), DEGREE, mode="edge")
