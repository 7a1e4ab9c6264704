"""Samples that are missing, and times that are not equally spaced: filled in only where a study says so, and told."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping

import numpy as np

from fes_pin.data.recorded.recording import Recording

MOST_PER_SAMPLE = 100
"""Samples for each that was recorded, at most: beyond that nothing but straight lines is added."""
LONGEST_GAP = 5
"""Sample steps over which a straight line is drawn: what a rig does in longer ones nobody measured."""


def filled(
    recording: Recording, time: np.ndarray, columns: Mapping[str, np.ndarray], held: Collection[str], called: Mapping
) -> tuple[dict[str, np.ndarray], int]:
    """Columns with missing samples (NaN) filled in: an input holds its value, a reading is interpolated.

    Parameters
    ----------
    recording
        Names the place of what is wrong.
    time
        (n,) s.
    held
        Columns that are held.
    called
        The file's name of each column.

    Returns
    -------
    dict of ndarray, and how many samples were filled in

    Raises
    ------
    InputError
        A gap longer than `LONGEST_GAP` steps, or at an end of the recording.
    """
    count = 0
    out = {}
    for name, values in columns.items():
        there = ~np.isnan(values)
        _check_gaps(recording, time, there, called[name])
        count += int(np.count_nonzero(~there))
        out[name] = _at(time, time[there], values[there], name in held)
    return out, count


def resampled(
    recording: Recording,
    time: np.ndarray,
    columns: Mapping[str, np.ndarray],
    held: Collection[str],
    called: Mapping[str, str],
    rate_hz: float,
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Columns at equally spaced times: inputs hold their value, pulses keep their number, readings are interpolated.

    Nothing is filtered: what the recording holds above half of the new rate folds back.

    Raises
    ------
    InputError
        Times that do not increase, a step of more than `LONGEST_GAP` usual ones, two pulses in one new sample; a rate
        that makes fewer than 3 samples, or more than `MOST_PER_SAMPLE` for each that was recorded.
    """
    count = (time[-1] - time[0]) * rate_hz + 1e-6
    if not 2.0 <= count <= MOST_PER_SAMPLE * len(time):
        low, high = (f"{n / (time[-1] - time[0]):.3g}" for n in (2.0, MOST_PER_SAMPLE * len(time)))
        raise recording.error(f"expected to resample at {low} to {high} Hz, found {rate_hz:g} Hz", called["time_s"])
    grid = time[0] + np.arange(int(count) + 1) / rate_hz
    out = {}
    for name, values in columns.items():
        if name != "stim":
            out[name] = _at(grid, time, values, name in held)
            continue
        places = np.rint((time[values > 0.5] - grid[0]) * rate_hz).astype(int)
        places = np.minimum(places, len(grid) - 1)
        if len(np.unique(places)) < len(places):
            raise recording.error(f"two pulses come within one sample of {rate_hz:g} Hz; expected more", called[name])
        out[name] = np.zeros(len(grid))
        out[name][places] = 1.0
    return grid, out


def check_steps(recording: Recording, time: np.ndarray, called: str) -> None:
    """Require times that increase, without a hole.

    Raises
    ------
    InputError
        With the row.
    """
    if np.isnan(time).any():
        raise recording.error("expected a time, found nothing", called, int(np.argmax(np.isnan(time))))
    steps = np.diff(time)
    if not (steps > 0).all():
        raise recording.error("expected time to increase", called, int(np.argmax(steps <= 0)) + 1)
    longest, usual = int(np.argmax(steps)), float(np.median(steps))
    if steps[longest] > LONGEST_GAP * usual:
        found = f"expected steps of at most {LONGEST_GAP} usual ones of {usual:.4g} s, found {steps[longest]:.4g} s"
        raise recording.error(f"{found}; make two trials of it", called, longest + 1)


def _check_gaps(recording: Recording, time: np.ndarray, there: np.ndarray, called: str) -> None:
    if there.all():
        return
    if not there[0] or not there[-1]:
        sample = 0 if not there[0] else int(np.flatnonzero(there)[-1]) + 1 if there.any() else 0
        raise recording.error("a sample is missing at an end of the recording; cut it there", called, sample)
    steps = int(np.max(np.diff(np.flatnonzero(there))))
    if steps > LONGEST_GAP:
        first = next(a for a, b in itertools.pairwise(np.flatnonzero(there)) if b - a > LONGEST_GAP)
        found = f"{steps - 1} samples in a row are missing; expected at most {LONGEST_GAP - 1}"
        raise recording.error(f"{found}; make two trials of it", called, int(first) + 1)


def _at(times: np.ndarray, known: np.ndarray, values: np.ndarray, held: bool) -> np.ndarray:
    if not held:
        return np.interp(times, known, values)
    after = np.searchsorted(known, times + 1e-9 * (known[-1] - known[0]), side="right")
    return values[np.maximum(after - 1, 0)]
