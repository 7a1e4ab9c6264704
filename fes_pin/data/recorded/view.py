"""A trial as a view of recordings: which files it joins, which part of them it is, what is derived.

A view says nothing about columns: `[columns]` and `[sources.NAME]` do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from fes_pin.data.errors import KeyFault
from fes_pin.data.recorded.clock_offset import clock_offset
from fes_pin.data.recorded.parts import HOLES, RESTARTS, RESTS, changes, cut, holes, moving, restarts, rows_of
from fes_pin.data.recorded.regular import at_times
from fes_pin.data.schema import any_number, check_known, one_of, positive
from fes_pin.data.table import MIN_ROWS, Table, increasing_steps

FITTED = "fit"
"""The offset of a clock that the recordings themselves show."""
INTEGRATED = {"position": "velocity"}
"""What may be derived by integration, and of which column."""


@dataclass(frozen=True)
class View:
    """Which part of its recordings a trial is.

    Parameters
    ----------
    begin_s, end_s
        First and last time of the recording that belong to it, s; None: its ends.
    at
        Times at which it is cut, s.
    split
        "restarts", "holes", "rests", the name of a column at whose changes it is cut, or "".
    derive
        By the derived column the one that it is integrated from.
    rate_hz
        At which it is resampled; None: as `[columns.file]` says.
    offsets
        By source what is added to its times, s; `FITTED` where the recordings show it.
    is_joined
        Whether it has several sources.
    sheet
        Of a spreadsheet, or a structure of a file that nests vectors; "" for its first one, or the whole file.
    """

    begin_s: float | None = None
    end_s: float | None = None
    at: tuple[float, ...] = ()
    split: str = ""
    derive: Mapping[str, str] = field(default_factory=dict)
    rate_hz: float | None = None
    offsets: Mapping[str, float | str] = field(default_factory=dict)
    is_joined: bool = False
    sheet: str = ""

    @property
    def also(self) -> tuple[str, ...]:
        """Columns of the files that the view alone reads."""
        return () if self.split in ("", RESTARTS, HOLES, RESTS) else (self.split,)

    def overlaps(self, other: View) -> bool:
        """Return whether two views of one file have a stretch of time of one sheet in common."""
        begins = [-np.inf if v.begin_s is None else v.begin_s for v in (self, other)]
        ends = [np.inf if v.end_s is None else v.end_s for v in (self, other)]
        return self.sheet == other.sheet and max(begins) < min(ends)

    def parts(self, table: Table, readings: Sequence[str]) -> list[Table]:
        """The parts of a recording that are trials, in its order.

        Parameters
        ----------
        table
            As recorded; times may start again and have holes.
        readings
            Columns that rest where the rig does.

        Raises
        ------
        InputError
            The column of `split` is not there; fewer than 3 samples are left.
        """
        whole = self._window(table)
        if self.at:
            found = cut(whole, np.searchsorted(whole.time, self.at))
        elif self.split == RESTS:
            found = moving(whole, readings)
        else:
            found = cut(whole, self._places(whole))
        if not found:
            raise table.error(f"expected parts of at least {MIN_ROWS} samples, found none", "time_s")
        words = f"{table.path.name} is cut into {len(found)} trials at {self._words()}"
        said = (words,) if len(found) > 1 else ()
        return [_without(replace(one, said=(*one.said, *said)), self.also) for one in found]

    def _words(self) -> str:
        if self.at:
            return f"marks: {', '.join(f'{t:g}' for t in self.at[:4])}{' ...' * (len(self.at) > 4)} s"
        known = {RESTARTS: "times that start again", HOLES: "holes in time", RESTS: "rests"}
        return known.get(self.split, f"changes of {self.split}")

    def _window(self, table: Table) -> Table:
        if self.begin_s is None and self.end_s is None:
            return table
        low, high = (-np.inf if self.begin_s is None else self.begin_s), (np.inf if self.end_s is None else self.end_s)
        rows = np.flatnonzero((table.time >= low) & (table.time <= high))
        if len(rows) < MIN_ROWS:
            ends = f"{table.time[0]:g} to {table.time[-1]:g} s"
            raise table.error(f"expected at least {MIN_ROWS} samples, found {len(rows)} of those from {ends}", "time_s")
        return rows_of(table, slice(int(rows[0]), int(rows[-1]) + 1))

    def _places(self, table: Table) -> np.ndarray:
        if self.split in ("", HOLES):
            step = None if self.rate_hz is None else 1.0 / self.rate_hz
            return holes(table.time, step) if self.split else np.zeros(0, dtype=int)
        if self.split == RESTARTS:
            return restarts(table.time)
        if self.split not in table.columns:
            raise table.error(f"missing; split names it, and this file has {', '.join(table.names)[:200]}", self.split)
        return changes(table.columns[self.split])

    def derived(self, table: Table) -> Table:
        """The table with the columns that are derived, by the trapezoidal rule from 0."""
        columns, said = dict(table.columns), list(table.said)
        for name, source in self.derive.items():
            if source not in columns:
                raise table.error(f"missing; {name} is derived from it", source)
            steps = 0.5 * np.diff(table.time) * (columns[source][1:] + columns[source][:-1])
            columns[name] = np.concatenate([[0.0], np.cumsum(steps)])
            del columns[source]  # which says nothing more
            said.append(f"{name} is the integral of {source}, from 0, and takes its place")
        return replace(table, names=tuple(columns), columns=columns, said=tuple(said))


def _without(table: Table, names: Sequence[str]) -> Table:
    columns = {n: v for n, v in table.columns.items() if n not in names}
    return replace(table, names=tuple(columns), columns=columns)


def view_of(table: Mapping[str, Any], sources: Sequence[str], error: KeyFault) -> View:
    """The view that a `[[trial]]` states.

    Parameters
    ----------
    table
        Its keys, of which those of a view are read.
    sources
        Names of the sources whose clock may have an offset.
    error
        Makes the exception for a key and a message.

    Raises
    ------
    InputError
        What `error` makes, for a value that is not what it must be.
    """
    seconds = any_number("s")
    ends = {k: seconds.check(table[k], partial(error, k)) for k in ("from", "to") if k in table}
    if len(ends) > 1 and ends["from"] >= ends["to"]:
        raise error("to", f"expected a time after from = {ends['from']:g}, found {ends['to']:g}")
    marks, split = table.get("at", []), table.get("split", "")
    if not isinstance(marks, list):
        raise error("at", "expected a list of times in s")
    at = tuple(sorted(seconds.check(one, partial(error, "at")) for one in marks))
    if not isinstance(split, str) or (at and split):
        raise error("split", f'expected "{RESTARTS}", "{HOLES}", "{RESTS}" or the name of a column, and no at')
    rate = positive("Hz").check(table["rate"], partial(error, "rate")) if "rate" in table else None
    derive = _table(table, "derive", error)
    for name, source in derive.items():
        if INTEGRATED.get(name) != one_of(source, tuple(INTEGRATED.values()), partial(error, f"derive.{name}")):
            raise error(f"derive.{name}", 'expected position = "velocity"')
    offsets = _offsets(table, sources, error)
    sheet = table.get("sheet", "")
    if not isinstance(sheet, str):
        raise error("sheet", "expected the name of a sheet of a spreadsheet")
    return View(ends.get("from"), ends.get("to"), at, split, derive, rate, offsets, len(sources) > 1, sheet)


def _offsets(table: Mapping[str, Any], sources: Sequence[str], error: KeyFault) -> dict[str, float | str]:
    """By source what is added to its times, s, or `FITTED`."""
    offsets = _table(table, "offset_s", error)
    if not sources and offsets:
        raise error("offset_s", "expected it of a trial with sources, whose clocks differ")
    check_known(offsets, sources, lambda key, message: error(f"offset_s.{key}", message))
    seconds = any_number("s")
    return {n: v if v == FITTED else seconds.check(v, partial(error, f"offset_s.{n}")) for n, v in offsets.items()}


def _table(given: Mapping[str, Any], key: str, error: KeyFault) -> Mapping[str, Any]:
    value = given.get(key, {})
    if not isinstance(value, dict):
        raise error(key, "expected a table")
    return value


def joined(tables: Mapping[str, Table], offsets: Mapping[str, float | str], held: Sequence[str]) -> Table:
    """One table of several sources, on the times of the first one where all of them were recorded.

    Parameters
    ----------
    tables
        By the name of the source.
    offsets
        By source what is added to its times, s; `FITTED` where the recordings show it.
    held
        Columns that hold their value; others are interpolated linearly.

    Raises
    ------
    InputError
        A column that two sources have; sources that have no time in common; an offset that the recordings do not show.
    """
    (first, leading), *others = tables.items()
    columns, said, called = dict(leading.columns), list(leading.said), dict(leading.called)
    clocks = {}
    for name, table in others:
        shared = set(table.columns) & set(columns) - {"time_s"}
        if shared:
            raise table.error(f"is also in {first}; expected it in one of the sources", min(shared))
        offset = offsets.get(name, 0.0)
        own = {n: v for n, v in table.columns.items() if n != "time_s"}
        increasing_steps(table)  # or nothing stands between two of its rows
        if isinstance(offset, str):
            increasing_steps(leading)
            offset, words = clock_offset(leading, table)
            said.append(f"{1e3 * offset:.3g} ms are added to the times of {name}: {words}")
        elif offset:
            said.append(f"{1e3 * offset:.6g} ms are added to the times of {name}")
        clocks[name] = table.time + offset
        columns |= {n: at_times(leading.time, clocks[name], v, n in held) for n, v in own.items()}
        said += table.said
        called |= {n: table.called.get(n, n) for n in own}
    begin = max([leading.time[0], *(c[0] for c in clocks.values())])
    end = min([leading.time[-1], *(c[-1] for c in clocks.values())])
    rows = np.flatnonzero((leading.time >= begin) & (leading.time <= end))
    if len(rows) < MIN_ROWS:
        raise leading.error(f"the sources {', '.join(tables)} have no {MIN_ROWS} samples in common", "time_s")
    once = tuple(dict.fromkeys(said))  # what is the same of two sheets of one file
    whole = replace(leading, columns=columns, names=tuple(columns), said=once, called=called)
    return rows_of(whole, slice(int(rows[0]), int(rows[-1]) + 1))
