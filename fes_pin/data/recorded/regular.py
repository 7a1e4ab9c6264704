"""Missing samples, and times that are not equally spaced: filled in only where a study says so, and reported."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from fes_pin.data.table import STEP_TOLERANCE, Table, increasing_steps

MOST_PER_SAMPLE = 100
"""Samples for each that was recorded, at most: beyond that nothing but straight lines is added."""
LONGEST_GAP = 5
"""Sample steps over which a straight line is drawn: what a rig does in longer ones nobody measured."""


def filled(table: Table, held: Collection[str]) -> tuple[Table, int]:
    """A table with missing samples (NaN) filled in: an input holds its value, a reading is interpolated.

    Parameters
    ----------
    table
        Its times first.
    held
        Columns that are held.

    Returns
    -------
    Table, and how many samples were filled in

    Raises
    ------
    InputError
        A gap longer than `LONGEST_GAP` steps, or at an end of the recording.
    """
    count, out = 0, dict(table.columns)
    for name, values in table.columns.items():
        there = ~np.isnan(values)
        if not there.all():
            _check_gaps(table, there, name)
            count += int(np.count_nonzero(~there))
            out[name] = at_times(table.time, table.time[there], values[there], name in held)
    return replace(table, columns=out), count


def resampled(table: Table, held: Collection[str], rate_hz: float) -> Table:
    """Columns at equally spaced times: inputs hold their value, pulses keep their number, readings are interpolated.

    Nothing is filtered: what the recording holds above half of the new rate folds back.

    Raises
    ------
    InputError
        Times that do not increase, a step of more than `LONGEST_GAP` usual ones, two pulses in one new sample; a rate
        that makes fewer than 3 samples, or more than `MOST_PER_SAMPLE` for each that was recorded.
    """
    time = table.time
    count = (time[-1] - time[0]) * rate_hz + 1e-6
    if not 2.0 <= count <= MOST_PER_SAMPLE * len(time):
        low, high = (f"{n / (time[-1] - time[0]):.3g}" for n in (2.0, MOST_PER_SAMPLE * len(time)))
        raise table.error(f"expected to resample at {low} to {high} Hz, found {rate_hz:g} Hz", "time_s")
    grid = time[0] + np.arange(int(count) + 1) / rate_hz
    out = {"time_s": grid}
    for name, values in table.columns.items():
        if name == "stim":
            places = np.rint((time[values > 0.5] - grid[0]) * rate_hz).astype(int)
            places = np.minimum(places, len(grid) - 1)
            if len(np.unique(places)) < len(places):
                raise table.error(f"two pulses come within one sample of {rate_hz:g} Hz; expected more", name)
            out[name] = np.zeros(len(grid))
            out[name][places] = 1.0
        elif name != "time_s":
            out[name] = at_times(grid, time, values, name in held)
    return replace(table, columns=out, rows=table.rows[np.searchsorted(time, grid + 1e-9, side="right") - 1])


def check_steps(table: Table, rate_hz: float) -> tuple[str, ...]:
    """What is said of holes that are bridged: longer than `LONGEST_GAP` recorded steps, not than so many at a rate.

    Parameters
    ----------
    rate_hz
        At which the table will be resampled: with longer steps a hole of a fast recording is a short one.

    Raises
    ------
    InputError
        Times that do not increase, or a longer hole, with the row.
    """
    steps = increasing_steps(table)
    longest, usual = int(np.argmax(steps)), float(np.median(steps))
    longer = max(usual, 1.0 / rate_hz)
    if steps[longest] > LONGEST_GAP * longer * (1.0 + STEP_TOLERANCE):  # the rate may be a rounded one
        found = f"expected steps of at most {LONGEST_GAP} usual ones of {longer:.4g} s, found {steps[longest]:.4g} s"
        hint = 'split = "holes" of its [[trial]] makes two trials of it'
        raise table.error(f"{found}; {hint}", "time_s", longest + 1)
    if not (bridged := np.flatnonzero(steps > LONGEST_GAP * usual)).size:
        return ()
    most = f"{1e3 * steps[longest]:.4g} ms at {table.time[longest]:.6g} s"
    return (f"holes in time are bridged: {len(bridged)}, the longest {most}",)


def _check_gaps(table: Table, there: np.ndarray, name: str) -> None:
    if not there[0] or not there[-1]:
        sample = 0 if not there[0] else int(np.flatnonzero(there)[-1]) + 1 if there.any() else 0
        raise table.error(
            "a sample is missing at an end of the recording; cut it there: --set from=S, to=S", name, sample
        )
    known = np.flatnonzero(there)
    steps = np.diff(known)
    if (most := int(steps.max())) > LONGEST_GAP:
        found = f"{most - 1} samples in a row are missing; expected at most {LONGEST_GAP - 1}"
        raise table.error(
            f"{found}; from and to of a [[trial]] leave them out", name, int(known[np.argmax(steps > LONGEST_GAP)]) + 1
        )


def at_times(times: np.ndarray, known: np.ndarray, values: np.ndarray, held: bool) -> np.ndarray:
    """Values of known times at others: the last one before where they are held, else interpolated linearly."""
    if not held:
        return np.interp(times, known, values)
    after = np.searchsorted(known, times + 1e-9 * (known[-1] - known[0]), side="right")
    return values[np.maximum(after - 1, 0)]
