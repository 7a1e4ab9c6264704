"""Trials as rows of effort: the band of the motion, and the low pass that effort and every column have in common.

All columns of a regression of efforts must pass one filter (parallel filtering): linear ones by derivatives of a
Gaussian kernel on the reading itself, nonlinear ones by the kernel on their values along a wider motion.

Source: Gautier, Dynamic identification of robots with power model, IEEE ICRA 1997, for parallel decimation; Lindeberg,
Scale-space for discrete signals, IEEE Transactions on Pattern Analysis and Machine Intelligence 12 (1990), for kernels.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import erfcx

from fes_pin.data.errors import InputError
from fes_pin.data.spectra import ABOVE_NOISE, OF_POWER, QUIET, SEGMENT_S, SLOWEST_HZ, TIMES, pooled, spectrum
from fes_pin.data.trial import Trial
from fes_pin.infer.levels import SMALL_SHARE

FASTEST_HZ = 25.0
"""Largest band, Hz: flexible modes of laboratory joints lie above."""
OF_RATE = 0.2
"""Largest band as a share of the sample rate: a narrower Gaussian is no longer sampled."""
NOISE_SHARE = 0.003
"""Largest share of the variance of the acceleration that the noise of the reading may have. Errors of a regressor
shrink its coefficient by this share (Fuller, Measurement Error Models, 1987)."""
WIDER = 4.0
"""Cut-off of the wide motion, at least, in units of the band: friction and stops have corners."""
NARROWER = 0.9
"""Factor by which the band is lowered until the noise has that share."""
WIDTHS = 4.5
"""Half length of a kernel in its deviations: the tails beyond are 7e-6."""
ROWS_EACH = 2.5
"""Rows in a period of the band: the kernel passes 2 % of the amplitude at their Nyquist frequency plus one fifth."""
REVERSING, AROUND_S = 0.04, 0.02
"""Speed, as a share of a fast one, below which a joint reverses, and the time around it, s: friction is uncertain."""
RESTS = 2.0
"""Time on either side for which a joint that rests is slow, in deviations of the kernel: 95 % of its weight."""
BELOW_NOISE = "the recorded motion is not above the noise of its reading"
"""Why there is no band."""


@dataclass(frozen=True)
class Band:
    """Cut-off frequencies (-3 dB), Hz.

    Attributes
    ----------
    low
        Of effort and columns.
    wide
        Of the motion along which nonlinear columns are evaluated.
    noise
        Power of the noise of the reading, rad2/Hz or m2/Hz.
    """

    low: float
    wide: float
    noise: float = 0.0


def deviation_of(cutoff_hz: float) -> float:
    """Return the standard deviation, s, of the Gaussian kernel with a cut-off frequency."""
    return math.sqrt(math.log(2.0)) / (2.0 * math.pi * cutoff_hz)


def kernel(order: int, deviation: float, dt: float, late: float = 0.0, lag: float = 0.0) -> np.ndarray:
    """Return the weights of a derivative of a signal that is smoothed by a Gaussian, shape (2 half + 1,).

    Parameters
    ----------
    order
        0, 1 or 2.
    late
        Time by which the signal acts after it was recorded, s.
    lag
        Time constant of a first-order low pass besides, s.
    """
    half = math.ceil((WIDTHS * deviation + abs(late) + 6.0 * lag) / dt)
    at = np.arange(-half, half + 1) * dt
    x = -at - late
    if lag > 0.0:
        return _unit(np.exp(-0.5 * (x / deviation) ** 2) * _erfcx((deviation / lag - x / deviation) / math.sqrt(2.0)))
    gauss = np.exp(-0.5 * (x / deviation) ** 2)
    if order == 0:
        return _unit(gauss)
    if order == 1:
        slope = -x * gauss
        return slope / float(slope @ at)
    bend = (x**2 / deviation**2 - 1.0) * gauss
    bend -= bend.mean()
    return bend / float(0.5 * bend @ at**2)


def _unit(weights: np.ndarray) -> np.ndarray:
    return weights / weights.sum()


def _erfcx(x: np.ndarray) -> np.ndarray:
    """Return exp(x^2) erfc(x), finite where a lag is much longer than the kernel."""
    return np.asarray(erfcx(np.maximum(x, -25.0)))


@dataclass(frozen=True, eq=False)
class Record:
    """One trial as it was read: times from its origin, readings and efforts, shape (n,), and the kind of the trial."""

    name: str
    time: np.ndarray
    reading: np.ndarray
    effort: np.ndarray
    kind: str

    @classmethod
    def of(cls, trial: Trial) -> Record:
        """Return a trial with the columns "position" and "effort" as it was read."""
        return cls(trial.name, trial.since_origin, trial["position"], trial["effort"], trial.kind)

    @cached_property
    def dt(self) -> float:
        """Time step, s."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)


class Motion:
    """One trial in a band: its motion, and the common low pass, at rows.

    Parameters
    ----------
    record
        The trial.
    band
        The band of all trials.
    reading
        Another reading in the place of the recorded one, shape (n,).
    rows
        Samples of the rows; by default all that are free of the ends, as many as the band needs.

    Attributes
    ----------
    q, v
        Wide motion at all samples, shape (n,).
    rows
        Samples of the rows, shape (m,).
    """

    def __init__(
        self, record: Record, band: Band, reading: np.ndarray | None = None, rows: np.ndarray | None = None
    ) -> None:
        self.record, self.band, self.dt = record, band, record.dt
        self.reading = record.reading if reading is None else reading
        self.time = record.time
        self._narrow, self._wide = deviation_of(band.low), deviation_of(band.wide)
        edge = math.ceil(WIDTHS * (self._narrow + self._wide) / self.dt)
        stride = max(1, round(1.0 / (ROWS_EACH * band.low * self.dt)))
        self.rows = np.arange(edge, len(self.reading) - edge, stride) if rows is None else rows

    @cached_property
    def q(self) -> np.ndarray:
        """Wide position, shape (n,)."""
        return self.wide(0)

    @cached_property
    def v(self) -> np.ndarray:
        """Wide velocity, shape (n,)."""
        return self.wide(1)

    @cached_property
    def a(self) -> np.ndarray:
        """Wide acceleration, shape (n,)."""
        return self.wide(2)

    def wide(self, order: int) -> np.ndarray:
        """Return a derivative of the wide motion, shape (n,)."""
        weights = kernel(order, self._wide, self.dt)
        padded = np.pad(self.reading, len(weights) // 2, mode="edge")
        return np.convolve(padded, weights[::-1], mode="valid")

    def moved(self, order: int) -> np.ndarray:
        """Return a derivative of the low-passed reading at the rows, shape (m,)."""
        return self._at_rows(self.reading, kernel(order, self._narrow, self.dt))

    def low(self, values: np.ndarray) -> np.ndarray:
        """Return values along the wide motion, shape (n,), low-passed at the rows, shape (m,)."""
        return self._at_rows(values, kernel(0, self._narrow, self.dt))

    def effort(self, late: float, lag: float) -> np.ndarray:
        """Return the low-passed effort at the rows, which acts `late` s after it was recorded; see `kernel`."""
        return self._at_rows(self.record.effort, kernel(0, self._narrow, self.dt, late, lag))

    def _at_rows(self, values: np.ndarray, weights: np.ndarray) -> np.ndarray:
        half = len(weights) // 2
        first, last = half, len(values) - half
        if len(self.rows) and not first <= self.rows[0] <= self.rows[-1] < last:
            values, first = np.pad(values, half, mode="edge"), 0
        windows = np.lib.stride_tricks.sliding_window_view(values, len(weights))
        return np.asarray(windows[self.rows - first] @ weights)

    def reversing(self, fast: float) -> np.ndarray:
        """Return at which rows the joint reverses, shape (m,) of bool."""
        return self._near(self.slow(fast), AROUND_S)

    def resting(self, fast: float) -> np.ndarray:
        """Return at which rows the joint stands as long as the kernel lasts, shape (m,) of bool.

        Dry friction holds a joint that stands by any torque up to its limit.
        """
        return ~self._near(~self.slow(fast), RESTS * self._narrow)

    def slow(self, fast: float) -> np.ndarray:
        """Return at which samples the joint is hardly moved, shape (n,) of bool."""
        return np.asarray(np.abs(self.v) < REVERSING * fast)

    def _near(self, some: np.ndarray, seconds: float) -> np.ndarray:
        """Return which rows are at most so far from some samples, shape (m,) of bool."""
        return np.convolve(some, np.ones(2 * round(seconds / self.dt) + 1, bool), mode="same")[self.rows]


def band_of(records: Sequence[Record]) -> Band:
    """Return the band of the motion of trials.

    Raises
    ------
    InputError
        The motion is not above the noise of its reading, or trials are shorter than the kernels.
    """
    dt = max(r.dt for r in records)
    noise = float(np.median([_noise(r) for r in records]))
    frequency = np.arange(1.0 / SEGMENT_S, 0.5 / dt, 0.5 / SEGMENT_S)
    power = pooled([(np.diff(r.reading) / r.dt, r.dt) for r in records], frequency)
    of_noise = noise * (2.0 * np.sin(np.pi * frequency * dt) / dt) ** 2
    below = power > ABOVE_NOISE * of_noise
    last = int(np.argmin(below)) if not below.all() else len(power)
    if not last:
        raise InputError(BELOW_NOISE, column="position")
    whole, seen = np.cumsum(power[:last] - of_noise[:last]), float(frequency[last - 1])
    f98 = float(frequency[np.searchsorted(whole, OF_POWER * whole[-1])])
    most = OF_RATE / dt
    low = min(max(TIMES * f98, SLOWEST_HZ), max(min(FASTEST_HZ, most, seen), SLOWEST_HZ), most)
    while _noise_share(records, low, noise) > NOISE_SHARE and low > f98:
        low *= NARROWER
    if _noise_share(records, low, noise) > SMALL_SHARE:
        raise InputError(BELOW_NOISE, column="position")
    band = Band(low, min(max(WIDER * low, seen), most), noise)
    if not has_rows(records, band):
        raise InputError("every trial is shorter than the filter of its band", column="position")
    return band


def has_rows(records: Sequence[Record], band: Band) -> bool:
    """Return whether a trial is longer than the filter of a band."""
    return any(len(Motion(r, band).rows) for r in records)


def noise_of_bend(band: Band) -> float:
    """Return the variance of the low-passed acceleration by the noise of the reading.

    White noise of power S has S (2 pi)^4 times the integral of f^4 exp(-ln 2 (f / low)^2).
    """
    return band.noise * (2.0 * math.pi) ** 4 * 0.375 * math.sqrt(math.pi) * (band.low / math.sqrt(math.log(2.0))) ** 5


def noise_of_speed(band: Band) -> float:
    """Return the variance of the wide velocity by the noise of the reading: as above, the integral of f^2."""
    return band.noise * (2.0 * math.pi) ** 2 * 0.25 * math.sqrt(math.pi) * (band.wide / math.sqrt(math.log(2.0))) ** 3


def _noise_share(records: Sequence[Record], low: float, noise: float) -> float:
    """Return the share of the noise of the reading in the variance of the low-passed acceleration."""
    variance = noise_of_bend(Band(low, low, noise))
    tracks = [Motion(r, Band(low, WIDER * low)) for r in records]
    bends = [t.moved(2) for t in tracks if len(t.rows)]
    return variance / max(float(np.mean(np.concatenate(bends) ** 2)), 1e-300) if bends else math.inf


def _noise(record: Record) -> float:
    """Return the power of white noise of a reading, in its unit squared per Hz, by its second differences."""
    frequency, power = spectrum(np.diff(record.reading, 2), record.dt)
    high = frequency > QUIET * frequency[-1]
    return float(np.median(power[high] / (2.0 * np.sin(np.pi * frequency[high] * record.dt)) ** 4))
