"""By how much the clocks of two loggers differ, where one recorded a motion and the other the effort that goes with it.

The effort of a rig is explained by its acceleration, velocity, position and the direction in which it moves. At another
offset of the clocks it is explained less: the offset at which the sum of squares that is left is least is the estimate.
"""

from __future__ import annotations

import math

import numpy as np

from fes_pin.data.recorded.regular import MOST_PER_SAMPLE
from fes_pin.data.table import Table

MOST_S = 0.5
"""Largest offset that is looked for, s: loggers that one trigger starts, or one hand, differ by less."""
OF_THE_RECORD = 0.1
"""The same as a share of the shorter recording: the sources must overlap at every offset."""
EXPLAINED = 0.5
"""Least share of the effort that the motion explains at the best offset; else the recordings do not show it."""
SHARPER = 0.9
"""Largest ratio of the unexplained share at the best offset to its mean over all: else no offset is the best."""
OF_A_PERIOD, FINE = 0.1, 41
"""Part of a period of the band between rows that are compared, and between offsets that are tried first; number of
offsets that are tried about the best of these."""
OF_POWER, TIMES = 0.99, 3.0
"""The band reaches to so many times the frequency below which this share of the motion's power lies."""


def clock_offset(leading: Table, other: Table) -> tuple[float, str]:
    """What is to be added to the times of another recording, s, and a sentence about it.

    Parameters
    ----------
    leading, other
        Of which one has `position` or `velocity`, the other `effort`; times in s.

    Raises
    ------
    InputError
        They have not, or they do not show the offset.
    """
    pairs = ((leading, other, 1.0), (other, leading, -1.0))
    for moves, pushes, sign in pairs:
        motion = next((n for n in ("velocity", "position") if n in moves.columns), None)
        if motion is not None and "effort" in pushes.columns:
            lag, left, usual = _best_lag(moves, motion, pushes)
            if left > 1.0 - EXPLAINED or left > SHARPER * usual:
                break
            offset = sign * lag
            share = f"{100.0 * (1.0 - left):.3g} %"
            return offset, f"fitted, as the motion then explains most of the effort, {share}"
    message = "the recordings do not show by how much the clocks differ: expected a number of seconds in offset_s"
    raise other.error(message, "time_s")


def _best_lag(moves: Table, motion: str, pushes: Table) -> tuple[float, float, float]:
    """The time that added to an effort's clock explains most of it, s; the unexplained shares there and on average."""
    from fes_pin.data.smooth import low_pass  # noqa: PLC0415 - half a second of SciPy, for two clocks alone

    dt = float(np.median(np.diff(moves.time)))
    most = min(MOST_S, OF_THE_RECORD * min(float(np.ptp(t.time)) for t in (moves, pushes)))
    reach = math.ceil(most / dt)
    begin = max(moves.time[0], pushes.time[0] + reach * dt)  # where the effort was recorded at every offset
    count = int((min(moves.time[-1], pushes.time[-1] - reach * dt) - begin) / dt)
    known, effort = (v / max(float(np.abs(v).max()), 1e-300) for v in (moves.columns[motion], pushes.columns["effort"]))
    band = _band_hz(known, dt)
    edge = math.ceil(1.0 / (band * dt))  # over which a filter rings
    if not 3 * edge < count <= MOST_PER_SAMPLE * len(moves):  # too short, or mostly a hole
        return 0.0, 1.0, 1.0
    at = begin + np.arange(count) * dt
    columns = _columns(low_pass(np.interp(at, moves.time, known)[:, None], dt, band)[:, 0], motion, dt)
    around = begin + np.arange(-reach, count + reach) * dt
    smooth = low_pass(np.interp(around, pushes.time, effort)[:, None], dt, band)[:, 0]
    rows = slice(edge, count - edge, max(1, round(OF_A_PERIOD / (band * dt))))
    basis = np.linalg.qr(columns[rows] / np.maximum(np.abs(columns[rows]).max(axis=0), 1e-300))[0]

    def unexplained(later_s: np.ndarray) -> np.ndarray:
        """The share of an effort so much later that the motion does not explain, shape (lags,)."""
        efforts = np.array([np.interp(at[rows] + lag, around, smooth) for lag in later_s])
        power = np.sum((efforts - efforts.mean(axis=1, keepdims=True)) ** 2, axis=1)
        return (np.sum(efforts**2, axis=1) - np.sum((efforts @ basis) ** 2, axis=1)) / np.maximum(power, 1e-300)

    step = OF_A_PERIOD / band
    lags = np.linspace(-most, most, 2 * math.ceil(most / step) + 1)
    shares = unexplained(lags)
    fine = lags[int(np.argmin(shares))] + np.linspace(-step, step, FINE)
    found = unexplained(fine)
    k = int(np.clip(np.argmin(found), 1, FINE - 2))
    before, least, after = found[k - 1 : k + 2]
    bend = before - 2.0 * least + after
    part = float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5)) if bend > 0.0 else 0.0
    return -float(fine[k] + part * (fine[1] - fine[0])), float(max(least, 0.0)), float(shares.mean())


def _columns(known: np.ndarray, motion: str, dt: float) -> np.ndarray:
    """Acceleration, velocity, position, direction and 1, shape (n, 5)."""
    velocity = known if motion == "velocity" else np.gradient(known, dt)
    position = known if motion == "position" else np.cumsum(known) * dt
    usual = max(float(np.sqrt(np.mean(velocity**2))), 1e-300)
    direction = np.tanh(velocity / (0.05 * usual))
    return np.column_stack([np.gradient(velocity, dt), velocity, position, direction, np.ones_like(known)])


def _band_hz(values: np.ndarray, dt: float) -> float:
    """A frequency above which there is hardly motion, Hz."""
    power = np.cumsum(np.abs(np.fft.rfft(values - values.mean())) ** 2)
    frequency = np.fft.rfftfreq(len(values), dt)
    below = float(frequency[np.searchsorted(power, OF_POWER * power[-1])])
    return min(max(TIMES * below, 4.0 / (len(values) * dt)), 0.4 / dt)
