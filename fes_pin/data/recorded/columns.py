"""Columns of recordings as a rig has them: which column of a file is which of the rig's, in which unit."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fes_pin.data.errors import listed
from fes_pin.data.recorded.events import sampled_events
from fes_pin.data.recorded.form import TextForm
from fes_pin.data.recorded.formats import read_recording
from fes_pin.data.recorded.parts import without_empty_end
from fes_pin.data.recorded.regular import check_steps, filled, resampled
from fes_pin.data.recorded.wraps import table_without_wraps
from fes_pin.data.schema import RigSchema
from fes_pin.data.table import Table
from fes_pin.data.units import factor_of, known_unit, quantities_of, stated_unit

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
    is_stated
        Whether a person said what the numbers are: a unit, a scale, an edge.
    """

    name: str
    factor: float = 1.0
    scale: float = 1.0
    zero: float = 0.0
    edge: float | None = None
    rate_hz: float | None = None
    is_stated: bool = False

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
    revolute
        Whether the rig's joint turns; None if it has none, or that is not known.
    scaled
        Columns whose scale is stated.
    events
        Whether there is a row only where something changes.
    """

    sources: Mapping[str, ColumnSource]
    ignored: tuple[str, ...] = ()
    form: TextForm = field(default_factory=TextForm)
    resample_hz: float | None = None
    fills: bool = False
    revolute: bool | None = None
    scaled: frozenset[str] = frozenset()
    events: bool = False

    def factors(self) -> dict[str, float]:
        """What numbers are multiplied by as their unit is stated, by column; NaN where a scale is stated."""
        return {c: math.nan if c in self.scaled else s.factor for c, s in self.sources.items()}

    def read(self, path: str | Path, schema: RigSchema, kind: str, inputs_only: bool = False) -> Table:
        """The rig's columns of one recording, as a trial has them: `taken`, then `regular`."""
        return self.regular(self.taken(path, schema, kind, inputs_only), schema.stimuli(kind))

    def taken(
        self, path: str | Path, schema: RigSchema, kind: str, inputs_only: bool = False, also: Collection[str] = ()
    ) -> Table:
        """The rig's columns of one recording, in the study format's units, time first, sample by sample as recorded.

        Parameters
        ----------
        also
            Columns of the file that are read as they are, where it has them.

        Raises
        ------
        InputError
            As `read_recording`; a column that is missing, or neither taken nor ignored.
        """
        names = tuple(dict.fromkeys([s.name for s in self.sources.values() if s.name] + list(schema.columns)))
        recording = read_recording(path, self.form, (*names, *also))
        taken = self._taken(recording, schema, kind, inputs_only, also)
        time, half_digit = self._time(recording, taken.get("time_s"))
        columns = {c: s(recording.columns[s.name]) for c, s in taken.items() if c != "time_s"}
        columns |= {n: recording.columns[n] for n in also if n in recording.columns and n not in columns}
        called = {column: source.name or column for column, source in taken.items()}
        columns = {"time_s": time, **columns}
        whole = replace(recording, called=called, names=tuple(columns), columns=columns, half_digit=half_digit)
        return without_empty_end(whole, ("time_s",))

    def regular(self, table: Table, held: tuple[str, ...]) -> Table:
        """A table without missing samples, at equally spaced times where a rate is stated.

        Parameters
        ----------
        held
            Columns whose value holds until the next sample.

        Raises
        ------
        InputError
            Samples that are missing or times that are not equally spaced, where nothing says what to do with them.
        """
        table = self._regular(table, held)
        return replace(table, half_digit=table.half_digit if self.resample_hz is None else 0.0)

    def _taken(
        self, recording: Table, schema: RigSchema, kind: str, inputs_only: bool, also: Collection[str]
    ) -> dict[str, ColumnSource]:
        """Sources of this file's columns; a column of the file that no source names is an error."""
        measured = () if inputs_only else (schema.outputs[kind],)
        needed = {"time_s", *schema.stimuli(kind), *schema.motion(kind)[:1], *measured}
        known = schema.columns_of(kind)
        taken = self._stated_in(recording, needed, known)
        declared = {*self.ignored, *also, *(s.name for s in self.sources.values())}
        for name in (n for n in recording.names if n not in declared):
            if name not in known or name in taken:
                expected = f"this rig reads {', '.join(known)}"
                raise recording.error(f"expected it in [columns], or there among `ignored`; {expected}", name)
            taken[name] = ColumnSource(name)
        for column, source in taken.items():
            unit = recording.units.get(source.name, "")
            if not source.is_stated and unit and (why := unsaid(column, source.name, unit)):
                raise recording.error(why, source.name)
        return {c: taken[c] for c in ("time_s", *(n for n in taken if n != "time_s")) if c in taken}

    def _stated_in(self, recording: Table, needed: set[str], known: Collection[str]) -> dict[str, ColumnSource]:
        """Sources of `[columns]` that this file has; one that it lacks and the rig needs is an error."""
        taken = {}
        for column, source in self.sources.items():
            if column not in known:  # read in trials of another kind
                continue
            if not source.name or source.name in recording.names:
                taken[column] = source
            elif column in needed:
                message = f"missing; [columns] takes {column} from it, and this file has {listed(recording.names)}"
                raise recording.error(message, source.name)
        return taken

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
        if self.fills or self.resample_hz is not None:
            table = table_without_wraps(table, self.revolute)
        said = list(table.said)
        for name, values in table.columns.items():
            if np.isnan(values).any() and (name == "time_s" or not self.fills):
                how = f'missing = "{INTERPOLATE}" in [columns.file], or --fill, fills in short gaps'
                hint = f"a number, found nothing; {how}"
                expected = "a time, found nothing" if name == "time_s" else hint
                raise table.error(f"expected {expected}", name, int(np.argmax(np.isnan(values))))
        if self.events and self.resample_hz is not None:
            return sampled_events(table, self.resample_hz)
        if self.resample_hz is not None:
            said += check_steps(table, self.resample_hz)
        if self.fills:
            table, count = filled(table, held)
            said += [f"{count} missing samples are filled in"] if count else []
        if self.resample_hz is not None:
            steps = np.diff(table.time)
            table = resampled(table, held, self.resample_hz)
            said.append(f"{_steps_in_words(steps)} are interpolated to {self.resample_hz:g} Hz, without a filter")
        return replace(table, said=tuple(said))


def _steps_in_words(steps: np.ndarray) -> str:
    """What time steps were, s: alike for trials of one log, so that it is said once of them."""
    usual, most = float(np.median(steps)), round(float(steps.max() / np.median(steps)))
    longest = f", the longest {most} of them," if most > 1 else ""
    return f"time steps of about {1e3 * usual:.3g} ms{longest}"


def unsaid(column: str, name: str, unit: str, revolute: bool | None = None) -> str:
    """What is missing where a file states other numbers than a rig's column holds; "" where they may be the same.

    Parameters
    ----------
    unit
        As the file states it apart from the name; "" where it states none.
    """
    quantity, stated = stated_unit(name, unit)
    if not quantity and not stated:
        return ""
    says = "the file" if unit else "the name"
    known = known_unit(stated, quantities_of(column, revolute))
    if known is not None:
        is_own = factor_of(stated, column, revolute) == 1.0
        return "" if is_own else f"missing, and {says} says {stated}: expected the unit of the numbers"
    if not quantities_of(column, revolute) or (column == "stim" and quantity != "current"):
        return ""
    return f"missing, and {says} says {f'a {quantity}, {stated}' if quantity else stated}: expected a unit or a scale"
