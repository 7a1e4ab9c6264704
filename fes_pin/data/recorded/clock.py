"""Times of clocks, as loggers write them: dates, times of day, seconds since 1970."""

import math
import re
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from fes_pin.data.table import Table

_OF_DAY = re.compile(r"^(?:(?P<h>\d{1,3}):)?(?P<m>\d{1,2}):(?P<s>\d{1,2}(?P<part>[.,]\d+)?)$")
_DATED = re.compile(
    r"^(?P<date>\d{4}-\d\d-\d\d)[T ](?P<time>\d\d:\d\d(?::\d\d(?:[.,]\d+)?)?)(?P<zone>Z|[+-]\d\d:?\d\d)?$"
)
_OTHER_DATE = re.compile(r"^\d{1,4}[./-]\d{1,2}[./-]\d{1,4}[T ]+(?P<time>\d{1,2}:\d\d:\d\d(?:[.,]\d+)?)$")
DAY_S = 86400.0
"""Of midnight to midnight, s."""
FIRST_S, LAST_S = datetime(2001, 9, 9, tzinfo=UTC).timestamp(), datetime(2100, 1, 1, tzinfo=UTC).timestamp()
"""Seconds since 1970 that are taken for a date: from when they have ten digits to the end of the century."""
TICKS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
"""Ticks a second of what counts since 1970, by the unit."""


def clock_seconds(cell: str) -> tuple[float, str] | None:
    """Seconds of a date with a time (of any origin), or of a time of day, h:m:s or m:s.f; None of what is neither.

    Returns
    -------
    seconds, and which of the two it is in words
        A date whose day and month cannot be told apart counts by its time of day.
    """
    if ":" not in cell:
        return None
    if dated := _DATED.match(cell):
        zone = (dated["zone"] or "Z").replace("Z", "+00:00")
        whole, _, part = dated["time"].replace(",", ".").partition(".")
        try:
            moment = datetime.fromisoformat(f"{dated['date']}T{whole}{zone}")
        except ValueError:
            return None
        return moment.timestamp() + float(f"0.{part or 0}"), "dates"
    other = _OTHER_DATE.match(cell)
    found = _OF_DAY.match(other["time"] if other else cell)
    if found is None or (found["h"] is None and found["part"] is None):
        return None  # 12:30 may be either
    hours, minutes, seconds = float(found["h"] or 0), float(found["m"]), float(found["s"].replace(",", "."))
    if minutes >= 60.0 or seconds >= 60.0:
        return None
    return 3600.0 * hours + 60.0 * minutes + seconds, "times of day"


def from_first(seconds: np.ndarray, of_day: bool) -> np.ndarray:
    """Seconds from the first row, shape (n,); a time of day that falls by more than half a day has passed midnight."""
    there = np.flatnonzero(np.isfinite(seconds))
    if not len(there):
        return seconds
    out = seconds - seconds[there[0]]
    if of_day:
        out[there[1:]] += DAY_S * np.cumsum(np.diff(out[there]) < -0.5 * DAY_S)
    return out


def since_first(recording: Table) -> Table:
    """A recording whose columns of seconds since 1970, or of ms, us or ns, count from their first row; `said` has it.

    A column is one where it never falls and all of it lies between 2001 and 2100.
    """
    columns, units, said = dict(recording.columns), dict(recording.units), list(recording.said)
    for name, values in recording.columns.items():
        if (unit := _unix_unit(values)) and units.get(name, unit) == unit:
            moment = datetime.fromtimestamp(values[0] / TICKS[unit], UTC).isoformat(sep=" ", timespec="milliseconds")
            columns[name], units[name] = values - values[0], unit
            said.append(f"{name} is taken as {unit} since 1970: it counts from its first row, {moment}")
    return replace(recording, columns=columns, units=units, said=tuple(said))


def _unix_unit(values: np.ndarray) -> str:
    if len(values) < 2 or not math.isfinite(values[0]) or not values[0] >= FIRST_S:
        return ""
    steps = np.diff(values)
    if not (steps >= 0.0).all() or not (steps > 0.0).any():
        return ""
    return next((u for u, n in TICKS.items() if n * FIRST_S <= values[0] and values[-1] <= n * LAST_S), "")
