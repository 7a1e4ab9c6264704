"""The table `[columns]` of a study: which column of the recordings is which of the rig's, in which unit."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fes_pin.data.errors import KeyFault
from fes_pin.data.recorded.events import EVENTS, sampled_events
from fes_pin.data.recorded.formats import read_recording
from fes_pin.data.recorded.regular import check_steps, filled, resampled
from fes_pin.data.recorded.text import DECIMALS, DELIMITERS, ENCODINGS, TextForm
from fes_pin.data.schema import RigSchema, any_number, check_known, one_of, positive, unknown
from fes_pin.data.table import Table
from fes_pin.data.units import factor_of, unit_in_name

FILE_KEYS = ("delimiter", "decimal", "header_row", "first_row", "comment", "encoding", "resample_hz", "missing", "rows")
SOURCE_KEYS = ("name", "unit", "scale", "zero", "edge", "rate_hz")
INTERPOLATE = "interpolate"


@dataclass(frozen=True)
class ColumnSource:
    """Where a rig's column comes from: `value = scale * factor * (recorded - zero)`.

    Parameters
    ----------
    name
        Of the column in the file; "" for times that are made from a rate.
    factor
        What the recorded unit is in the study format's own.
    scale
        1; -1 where the recording counts the other way; radians a count, newtons a volt.
    zero
        The recorded reading that means zero.
    edge
        Of `stim`: a pulse begins where the recording rises above this.
    rate_hz
        Of `time_s`: the sample rate of a file without times.
    """

    name: str
    factor: float = 1.0
    scale: float = 1.0
    zero: float = 0.0
    edge: float | None = None
    rate_hz: float | None = None

    def __call__(self, recorded: np.ndarray) -> np.ndarray:
        """The study's numbers of what was recorded, shape (n,)."""
        if self.edge is not None:
            above = recorded > self.edge
            return np.r_[0.0, (above[1:] & ~above[:-1]).astype(float)]
        return self.scale * self.factor * (recorded - self.zero)


@dataclass(frozen=True)
class Columns:
    """How the recordings of a study are read.

    Parameters
    ----------
    sources
        By the rig's column.
    ignored
        Columns of the files that are passed over.
    form
        Of text files.
    resample_hz
        None: times must be equally spaced.
    fills
        Whether missing samples are filled in.
    events
        Whether there is a row only where something changes.
    """

    sources: Mapping[str, ColumnSource]
    ignored: tuple[str, ...] = ()
    form: TextForm = field(default_factory=TextForm)
    resample_hz: float | None = None
    fills: bool = False
    events: bool = False

    def read(self, path: str | Path, schema: RigSchema, kind: str, inputs_only: bool = False) -> Table:
        """The rig's columns of one recording, in the study format's units, time first; `said` has what was done to them.

        Raises
        ------
        InputError
            As `read_recording`; a column that is missing, or neither taken nor ignored; samples that are missing or
            times that are not equally spaced, where the table does not say what to do with them.
        """
        names = tuple(dict.fromkeys([s.name for s in self.sources.values() if s.name] + list(schema.columns)))
        recording = read_recording(path, self.form, names)
        taken = self._taken(recording, schema, kind, inputs_only)
        time, half_digit = self._time(recording, taken.get("time_s"))
        columns = {c: s(recording.columns[s.name]) for c, s in taken.items() if c != "time_s"}
        called = {column: source.name or column for column, source in taken.items()}
        table = replace(recording, called=called, names=("time_s", *columns), columns={"time_s": time, **columns})
        table = self._regular(table, schema.stimuli(kind))
        return replace(table, half_digit=half_digit if self.resample_hz is None else 0.0)

    def _taken(self, recording: Table, schema: RigSchema, kind: str, inputs_only: bool) -> dict[str, ColumnSource]:
        """Sources of this file's columns; a column of the file that no source names is an error."""
        measured = () if inputs_only else (schema.outputs[kind],)
        needed = {"time_s", *schema.stimuli(kind), *schema.motion(kind)[:1], *measured}
        known = schema.columns_of(kind)
        taken = {}
        for column, source in self.sources.items():
            if column not in known:  # read in trials of another kind
                continue
            if source.name and source.name not in recording.names:
                if column in needed:
                    has = ", ".join(recording.names)[:200]
                    message = f"missing; [columns] takes {column} from it, and this file has {has}"
                    raise recording.error(message, source.name)
                continue
            taken[column] = source
        declared = {*self.ignored, *(s.name for s in self.sources.values())}
        for name in recording.names:
            if name in declared:
                continue
            if name not in known or name in taken:
                expected = f"this rig reads {', '.join(known)}"
                raise recording.error(f"expected it in [columns], or there among `ignored`; {expected}", name)
            taken[name] = ColumnSource(name)
        return {c: taken[c] for c in ("time_s", *(n for n in taken if n != "time_s")) if c in taken}

    def _time(self, recording: Table, source: ColumnSource | None) -> tuple[np.ndarray, float]:
        """Times, s, and half of the last digit that they were printed with."""
        if source is None:
            raise recording.error("missing; expected [columns] to say which column it is, or its rate_hz", "time_s")
        if source.rate_hz is not None:
            return np.arange(len(recording)) / source.rate_hz, 0.0
        half_digit = abs(source.scale * source.factor) * recording.half_digit_of(source.name)
        return source(recording.columns[source.name]), half_digit

    def _regular(self, table: Table, held: tuple[str, ...]) -> Table:
        """Times and columns without holes."""
        said = list(table.said)
        for name, values in table.columns.items():
            if np.isnan(values).any() and (name == "time_s" or not self.fills):
                hint = f'a number, found nothing; missing = "{INTERPOLATE}" in [columns.file] fills in short gaps'
                expected = "a time, found nothing" if name == "time_s" else hint
                raise table.error(f"expected {expected}", name, int(np.argmax(np.isnan(values))))
        if self.events and self.resample_hz is not None:
            return sampled_events(table, self.resample_hz)
        if self.resample_hz is not None:
            check_steps(table)
        if self.fills:
            table, count = filled(table, held)
            said += [f"{count} missing samples are filled in"] if count else []
        if self.resample_hz is not None:
            steps = np.diff(table.time)
            table = resampled(table, held, self.resample_hz)
            was = f"{1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms"
            said.append(f"time steps of {was} are interpolated to {self.resample_hz:g} Hz, without a filter")
        return replace(table, said=tuple(said))


def columns_of(table: Mapping[str, Any], schema: RigSchema, revolute: bool | None, error: KeyFault) -> Columns:
    """The table `[columns]` of a study, checked.

    Parameters
    ----------
    table
        As TOML gives it.
    revolute
        Whether the rig's joint turns or slides; None if it has none, or that is not known.
    error
        Makes the exception for a key below `columns` and a message.

    Raises
    ------
    Exception
        What `error` makes.
    """
    if len(schema.recordings) > 1:
        raise error("", f"expected no [columns] for rig {schema.name}: its files name their columns themselves")
    sources, ignored, about = {}, (), {}
    for key, value in table.items():
        if key == "ignored":
            if not isinstance(value, list) or not all(isinstance(one, str) for one in value):
                raise error(key, "expected a list of column names")
            ignored = tuple(value)
        elif key == "file":
            if not isinstance(value, dict):
                raise error(key, "expected a table [columns.file]")
            about = value
        elif key not in schema.columns:
            raise error(key, unknown(key, (*schema.columns, "ignored", "file")))
        else:
            sources[key] = _source(key, value, revolute, error)
    names = [s.name for s in sources.values() if s.name]
    for column, source in sources.items():
        if source.name in ignored or (source.name and names.count(source.name) > 1):
            raise error(column, f"{source.name!r} is named twice in [columns]")
    return _with_file(Columns(sources, ignored), about, error)


def _source(column: str, value: Any, revolute: bool | None, error: KeyFault) -> ColumnSource:
    given = {"name": value} if isinstance(value, str) else value
    if not isinstance(given, dict):
        raise error(column, 'expected the name of a column, or a table like { name = "Angle", unit = "deg" }')
    check_known(given, SOURCE_KEYS, lambda key, message: error(f"{column}.{key}", message))
    keys = [k for k in ("scale", "zero", "edge", "rate_hz") if k in given]
    numbers = {k: any_number("").check(given[k], partial(error, f"{column}.{k}")) for k in keys}
    rate = numbers.get("rate_hz")
    if rate is not None and (column != "time_s" or not rate > 0.0 or len(given) > 1):
        raise error(f"{column}.rate_hz", "expected a rate above 0, alone, and of time_s only")
    if "edge" in numbers and column != "stim":
        raise error(f"{column}.edge", "expected for stim only: where a recorded trigger rises above it, a pulse begins")
    if numbers.get("scale") == 0.0:
        raise error(f"{column}.scale", "expected a number other than 0")
    name, unit = given.get("name", ""), given.get("unit", "")
    if not isinstance(unit, str):
        raise error(f"{column}.unit", "expected a unit as text")
    if rate is None and (not isinstance(name, str) or not name):
        raise error(f"{column}.name", "expected the name of a column of the files")
    stated = "" if unit or "scale" in numbers else unit_in_name(name, column, revolute)
    if stated and factor_of(stated, column, revolute) != 1.0:
        raise error(f"{column}.unit", f"missing, and the name says {stated}: expected the unit of the numbers")
    factor = factor_of(unit, column, revolute, partial(error, f"{column}.unit")) if unit else 1.0
    return ColumnSource(name, factor, **numbers)


def _with_file(columns: Columns, about: Mapping[str, Any], error: KeyFault) -> Columns:
    """With what `[columns.file]` says of how the files are written."""
    form: dict[str, Any] = {}
    check_known(about, FILE_KEYS, lambda key, message: error(f"file.{key}", message))
    for key, value in about.items():
        where = f"file.{key}"
        known = {
            "delimiter": DELIMITERS,
            "decimal": DECIMALS,
            "encoding": ENCODINGS,
            "missing": (INTERPOLATE,),
            "rows": (EVENTS,),
        }
        if key in known:
            form[key] = one_of(value, known[key], partial(error, where))
        elif key == "comment":
            if not isinstance(value, str) or not value.strip():
                raise error(where, "expected what a comment begins with")
            form[key] = value.strip()
        elif key == "resample_hz":
            form[key] = positive("Hz").check(value, partial(error, where))
        elif isinstance(value, bool) or not isinstance(value, int) or value < (key == "first_row"):
            raise error(where, "expected the number of a line, from 1" + (" (0: no header)" * (key == "header_row")))
        else:
            form[key] = value
    rate, missing, rows = (form.pop(key, None) for key in ("resample_hz", "missing", "rows"))
    if rows is not None and rate is None:
        raise error("file.rows", f'expected resample_hz as well: rows = "{EVENTS}" are held from step to step')
    form.setdefault("first_row", form.get("header_row", 1) + 1)
    text = TextForm(**form)
    if text.first_row <= text.header_row:
        raise error("file.first_row", f"expected a line below the header in line {text.header_row}")
    return replace(columns, form=text, resample_hz=rate, fills=missing is not None, events=rows is not None)
