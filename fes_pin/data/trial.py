"""A trial: one recording or one simulation, the same type, so that their residual is a subtraction."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from fes_pin.data.as_read import AsRead, digest_of, hashing
from fes_pin.data.checks import check_columns, check_values, checked_label, checked_labels, checked_mapping
from fes_pin.data.errors import InputError, as_text, errors_of, fault_at
from fes_pin.data.files import as_path
from fes_pin.data.motion import (
    GROUND_REACTION,
    coordinates_of,
    ground_reaction_of,
    named_coordinates,
    on_common_time,
    plates_in,
    read_motion,
    stated_degrees,
)
from fes_pin.data.numbers import instance
from fes_pin.data.outputs import written_by
from fes_pin.data.read_only import ReadOnly
from fes_pin.data.recorded.columns import Columns
from fes_pin.data.recorded.parts import HOLES, RESTARTS, holes, restarts
from fes_pin.data.recorded.sniff import NEW_STUDY, read_csv_or_hint
from fes_pin.data.recorded.view import View, joined
from fes_pin.data.schema import (
    NumberKey,
    RigSchema,
    check_conditions,
    checked_numbers,
    number_or_none,
    schema_of,
)
from fes_pin.data.show import DataFrame, frame
from fes_pin.data.table import MIN_ROWS, Table, check_time, check_times, format_csv
from fes_pin.data.walk_conventions import conventional

OF_THE_START = ("position0", "velocity0")
"""Conditions that state where a trial begins: of its later parts they say nothing."""
BEGAN = "start_s"
"""The condition that states when a trial began in its session."""


@dataclass(frozen=True, eq=False, repr=False)
class Trial(ReadOnly):
    """One recording or one simulation.

    Parameters
    ----------
    name
        Of the trial within its study, e.g. the stem of its file.
    kind
        "motion", "isometric" or "imposed"; "" leaves it to the trial's study, see `data.direction`.
    columns : mapping of str to ndarray, shape (n,)
        Every column but the time, by its name with its unit. The arrays are copied and made read-only.
    time : ndarray, shape (n,)
        s, strictly increasing in equal steps.
    conditions
        Numbers of this trial by name: `load_kg`, `angle_rad`, `start_s`, `belt_speed_mps`.
    role
        "fit", "held_out", or None: not decided by the study.
    group
        A label of the condition that it was measured under, or None.
    remarks
        What was done to its samples when it was read: filled in, interpolated.
    low_pass_hz
        Where its readings were low-passed, without delay, before they were stored, Hz; None where they were not. What
        is simulated of the trial is low-passed there as well.
    as_read
        The files that it was read from; None of a trial that was made in memory. Not compared.
    origin_s
        Time at which the trial began of which it is a part, s: causes that depend on time count from there. None: it
        begins with its own first sample.

    Raises
    ------
    InputError
        Fewer than 3 samples, times that do not increase in equal steps (as `fes_pin.data.table.check_times` says), a
        column that is not as long as the time, numbers that are not finite, another role, a condition or an
        origin that is not a number.
    """

    name: str
    kind: str
    columns: Mapping[str, np.ndarray]
    time: np.ndarray
    conditions: Mapping[str, float] = field(default_factory=dict)
    role: str | None = None
    group: str | None = None
    remarks: tuple[str, ...] = ()
    low_pass_hz: float | None = None
    as_read: AsRead | None = field(default=None, compare=False)
    origin_s: float | None = None

    def __post_init__(self) -> None:
        error = self.key_error
        labels = checked_labels(self.name, vars(self), error)
        if self.kind != "":
            checked_label(self.kind, error, "kind", "a kind")
        given = {key: checked_mapping(getattr(self, key), error, key) for key in ("columns", "conditions")}
        conditions = checked_numbers(given["conditions"], dict.fromkeys(given["conditions"], NumberKey("")), error)
        origin = number_or_none(self.origin_s, NumberKey("s"), "origin_s", error)
        time = _numbers(self.time, "time_s", self)
        columns = {name: _numbers(values, name, self) for name, values in given["columns"].items()}
        if self.as_read is not None:
            instance(self.as_read, AsRead, "as_read")
        if len(time) < MIN_ROWS:
            raise self.error(f"expected at least {MIN_ROWS} samples, found {len(time)}", "time_s")
        if odd := [name for name, values in columns.items() if values.shape != time.shape]:
            raise self.error(f"expected shape {time.shape} as of the time, found {columns[odd[0]].shape}", odd[0])
        check_times(time, self.error, half_digit=self.as_read.half_digit if self.as_read else None)
        vars(self).update(labels, time=time, columns=columns, conditions=conditions, origin_s=origin)
        self._freeze()

    def error(self, message: str, column: str, sample: int | None = None) -> InputError:
        """The error that names a column, this trial and a sample."""
        place = f"trial {self.name}" + ("" if sample is None else f", sample {sample}")
        return InputError(f"{message} ({place})", column=column)

    def key_error(self, key: str, message: str) -> InputError:
        """The error that names a key, or a column, and this trial."""
        return self.error(message, key)

    def __hash__(self) -> int:
        ends = float(self.time[0]), float(self.time[-1])
        return hash((self.name, self.kind, len(self), frozenset(self.columns), *ends))

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, column: str) -> np.ndarray:
        try:
            return self.columns[column]
        except KeyError:
            raise KeyError(f"trial {self.name} has no column {column!r}; it has {', '.join(self.columns)}") from None

    def __contains__(self, column: object) -> bool:
        return column in self.columns

    @property
    def is_edited(self) -> bool:
        """Whether its numbers are not those of the files that it was read from."""
        return self.as_read is not None and self.as_read.digest != self.digest()

    def digest(self) -> bytes:
        """A short hash of its numbers."""
        return digest_of((self.time, *(part for name in sorted(self.columns) for part in (name, self[name]))))

    @cached_property
    def dt(self) -> float:
        """Time step, s: the mean one, which printing rounds less than any single one."""
        return float(self.time[-1] - self.time[0]) / (len(self) - 1)

    @property
    def duration(self) -> float:
        """Time from the first to the last sample, s."""
        return float(self.time[-1] - self.time[0])

    @property
    def since_origin(self) -> np.ndarray:
        """Time since it began, or since the trial did of which it is a part, s, shape (n,)."""
        return self.time - (self.time[0] if self.origin_s is None else self.origin_s)

    def first(self, count: int) -> Trial:
        """The trial's first samples, itself if it has no more than `count`.

        Raises
        ------
        InputError
            Fewer than 3 samples.
        """
        if count >= len(self):
            return self
        if count < MIN_ROWS:
            raise InputError(f"expected at least {MIN_ROWS} samples, found {count}", column="count")
        return self.part(slice(0, count))

    def between(self, start_s: float, end_s: float) -> Trial:
        """The samples of a stretch of time, both ends among them, as a trial of its own; the times stay as they are.

        What was stated of its beginning (`position0`, `velocity0`) is lost where that is cut off, and a remark says so:
        a model of an ankle or a muscle begins at rest.

        Raises
        ------
        InputError
            Fewer than 3 samples lie there.
        """
        rows = np.flatnonzero((self.time >= start_s - 1e-6 * self.dt) & (self.time <= end_s + 1e-6 * self.dt))
        if len(rows) < MIN_ROWS:
            ends = f"{self.time[0]:g} to {self.time[-1]:g} s"
            raise self.error(f"expected at least {MIN_ROWS} samples, found {len(rows)} of those from {ends}", "time_s")
        part = derived_trial(self.part(slice(int(rows[0]), int(rows[-1]) + 1)), origin_s=None)
        cut = f"the first {part.time[0] - self.time[0]:.4g} s are cut off"
        return part if part.time[0] == self.time[0] else derived_trial(part, remarks=(*self.remarks, cut))

    def part(self, rows: slice) -> Trial:
        """Some rows of the trial, with its origin; what was stated of its first sample is lost with that sample."""
        stated = {n: v for n, v in self.conditions.items() if not rows.start or n not in OF_THE_START}
        if rows.start and BEGAN in stated:
            stated[BEGAN] += float(self.time[rows.start] - self.time[0])
        columns = {n: v[rows] for n, v in self.columns.items()}
        origin = float(self.time[0]) if rows.start and self.origin_s is None else self.origin_s
        return derived_trial(self, columns=columns, time=self.time[rows], conditions=stated, origin_s=origin)

    def with_columns(self, **columns: np.ndarray) -> Trial:
        """The same trial with columns added or replaced, each of shape (n,)."""
        return replace(self, columns={**self.columns, **columns})

    def without(self, *columns: str) -> Trial:
        """The same trial without some columns.

        Raises
        ------
        KeyError
            If it has none of that name.
        """
        for name in columns:
            self[name]
        return derived_trial(self, columns={name: self.columns[name] for name in self.columns if name not in columns})

    def residual(self, simulated: Trial, column: str) -> np.ndarray:
        """This trial, measured, minus a simulated one, in one column.

        Returns
        -------
        ndarray, shape (n,)

        Raises
        ------
        KeyError
            If either has no such column.
        InputError
            If they were not sampled at the same times.
        """
        if len(self) != len(simulated) or not np.allclose(self.time, simulated.time, rtol=0.0, atol=1e-3 * self.dt):
            raise InputError(f"trials {self.name} and {simulated.name} were not sampled at the same times")
        return self[column] - simulated[column]

    def __repr__(self) -> str:
        conditions = "".join(f", {name} = {value:g}" for name, value in self.conditions.items())
        rate = f", {self.duration:.4g} s at {1.0 / self.dt:.4g} Hz" if len(self) > 1 else ""
        columns = ", ".join(self.columns)
        role = f", {self.role}" if self.role else ""
        return f"Trial {self.name} ({self.kind}{role}): {len(self)} samples{rate}{conditions}; {columns}"

    @classmethod
    def from_frame(cls, frame: Any, *, name: str, kind: str, **labels: Any) -> Trial:
        """A trial of a frame of pandas, or of a mapping of arrays: what `to_frame` gives, back again.

        Parameters
        ----------
        frame
            Columns by their name with its unit; the times as a column `time_s`, or as the index.
        name, kind, labels
            As `Trial` takes them: conditions, role, group ...

        Raises
        ------
        InputError
            There are no times, or two columns of one name; or as `Trial`.
        """

        def error(key: str, message: str) -> InputError:
            return InputError(f"{message} (trial {name})", column=key)

        columns = {str(key): values for key, values in checked_mapping(frame, error, "frame").items()}
        index = getattr(frame, "index", None)
        time = columns.pop("time_s", index if getattr(getattr(index, "dtype", None), "kind", "") == "f" else None)
        if time is None:
            raise error("time_s", "missing; expected a column of times or an index of them")
        return cls(name, kind, columns, time, **labels)

    def to_frame(self) -> DataFrame:
        """Every column against `time_s` as a frame of pandas; see `data.show.frame`."""
        return frame({"time_s": self.time, **self.columns}, index="time_s")


def derived_trial(trial: Trial, **changes: Any) -> Trial:
    """A trial that the library makes of another one: as `dataclasses.replace`, and its numbers are not checked again.

    What is not finite was not measured, or is a simulation that ran away.

    Parameters
    ----------
    changes
        Fields by name; columns and time as arrays of float, each of shape (n,).
    """
    state = {one.name: getattr(trial, one.name) for one in fields(trial)} | changes
    own = {id(values) for values in (trial.time, *trial.columns.values())}  # read-only already
    state["columns"] = {n: v if id(v) in own else np.array(v, dtype=float) for n, v in state["columns"].items()}
    state["time"] = state["time"] if id(state["time"]) in own else np.array(state["time"], dtype=float)
    made = object.__new__(Trial)
    made.__setstate__(state)
    return made


def _numbers(values: Any, name: str, trial: Trial) -> np.ndarray:
    """A copy of a column or of the time as finite numbers, shape (n,)."""
    if not isinstance(name, str) or (name == "time_s" and name in trial.columns):
        raise trial.error("expected names of columns as text, and the time by itself", str(name))
    try:
        given = np.ma.filled(values.astype(float), np.nan) if np.ma.isMaskedArray(values) else np.asarray(values)
        if given.dtype.kind not in "biufO" or (given.dtype.kind == "O" and any(isinstance(v, str) for v in given.flat)):
            raise ValueError
        array = np.array(given, dtype=float)
    except (TypeError, ValueError):
        raise trial.error(f"expected numbers, found {getattr(values, 'dtype', type(values).__name__)}", name) from None
    if array.ndim != 1:
        raise trial.error(f"expected shape (n,), found {array.shape}", name)
    if not (finite := np.isfinite(array)).all():
        sample = int(np.argmin(finite))
        raise trial.error(f"expected finite numbers, found {array[sample]}", name, sample)
    return array


def check_trial(
    trial: Trial,
    schema: RigSchema,
    *,
    inputs_only: bool = False,
    threshold_us: float = math.inf,
    also: Collection[str] = (),
) -> None:
    """Require of a trial what a rig's schema asks: its kind, conditions, columns, and units that can be.

    Parameters
    ----------
    inputs_only
        Do not require the measured outputs, to predict them.
    threshold_us
        Of the rig, where it is known: pulse widths above it are in us.
    also
        Further columns that it may have.

    Raises
    ------
    InputError
        Names the column or the condition and the trial.
    """
    kind = schema.kind_of(trial.kind, trial.key_error)
    check_conditions(schema, kind, trial.conditions, trial.key_error)
    check_columns([n for n in trial.columns if n not in also], schema, kind, inputs_only, trial.error)
    if "angle_rad" in trial.conditions:
        held = {"angle_rad": np.array([trial.conditions["angle_rad"]])}
        check_values(held, schema, lambda message, column, _: trial.error(message, column))
    check_values(trial.columns, schema, trial.error, threshold_us)


def read_trial(
    path: str | Path,
    *,
    rig: str | RigSchema,
    kind: str | None = None,
    conditions: Mapping[str, float] | None = None,
    role: str | None = None,
    inputs_only: bool = False,
    name: str | None = None,
    group: str | None = None,
    own: Columns | None = None,
    remarks: Sequence[str] = (),
    low_pass_hz: float | None = None,
) -> Trial:
    """Read one trial from its file.

    Parameters
    ----------
    path
        The file; for a body one that holds the coordinates and the ground reaction, or a .mot or .sto file.
    rig
        Its name ("ankle", "muscle", "joint", "body" ...), or what its studies must and may hold.
    kind
        Of those that the rig has, "motion", "isometric" or "imposed"; without it the rig's default.
    conditions, role, group, remarks, low_pass_hz
        As a `[[trial]]` table gives them; see `Trial`.
    inputs_only
        Do not require the measured outputs, to predict them; they are kept if they are there.
    name
        Of the trial; without it the stem of the file.
    own
        How the file is written and what its columns are, as the study's `[columns]` says; without it the file is a
        CSV as the study format has it.

    Raises
    ------
    InputError
        For anything that is not as the study format says: with file, row and column.
    """
    path = as_path(path)
    error = fault_at(file=path)
    schema = schema_of(rig, partial(error, "rig"))
    kind = schema.kind_of(kind, error)
    told = {"role": role, "group": group, "remarks": remarks, "low_pass_hz": low_pass_hz}
    labels = checked_labels(as_text(path.stem) if name is None else name, told, error)
    given = {} if conditions is None else checked_mapping(conditions, error, "conditions")
    labels |= {"kind": kind, "conditions": check_conditions(schema, kind, given, error)}
    if own is not None:
        instance(own, Columns, "own")
    if len(schema.recordings) > 1:
        with hashing() as sha256:
            columns, time = _body_columns(path, inputs_only)
        check_values(columns, schema, lambda message, column, _: error(column, message))
        return _made(columns, time, AsRead(sha256, b""), **labels)
    return read_view({"": (path, own)}, View(), schema, labels, inputs_only)[0]


Recordings = Mapping[str, tuple[Path, Columns | None]]
"""Files of a trial by the name of their source, and how each is written: None as the study format has it."""


def read_view(
    recordings: Recordings, view: View, schema: RigSchema, labels: Mapping[str, Any], inputs_only: bool = False
) -> list[Trial]:
    """The trials that a view makes of recordings: one, or its parts, which are called NAME-1, NAME-2 ...

    Parameters
    ----------
    labels
        Fields of each trial, checked; `position0` and `velocity0` are those of the first part alone.

    Raises
    ------
    InputError
        As `read_trial`, `joined`, `View.parts` and `View.derived`.
    """
    kind, held = labels["kind"], schema.stimuli(labels["kind"])
    with hashing() as sha256:
        tables = {n: _as_recorded(*one, schema, kind, inputs_only, view) for n, one in recordings.items()}
    own = next(iter(recordings.values()))[1] or Columns({})
    if len(tables) > 1:
        whole = {n: replace(recordings[n][1] or own, resample_hz=None).regular(t, held) for n, t in tables.items()}
        table = joined(whole, view.offsets, held)
    else:
        table = next(iter(tables.values()))
    if view.rate_hz is not None:
        own = replace(own, resample_hz=view.rate_hz)
    moved = [n for n in (*schema.outputs.values(), *schema.imposed, "velocity") if n in table.columns]
    parts = view.parts(table, [n for n in moved if n not in held] or moved)
    factors = {c: f for _, one in recordings.values() if one is not None for c, f in one.factors().items()}
    trials = []
    for place, part in enumerate(parts):
        regular = view.derived(own.regular(part, held))
        columns, time = _checked_columns(regular, schema, kind, inputs_only)
        fields_of = dict(labels) | {"remarks": (*labels["remarks"], *regular.said)}
        if len(parts) > 1:
            fields_of["name"] = f"{labels['name']}-{place + 1}"
            fields_of["conditions"] = _conditions_of(place, time[0] - table.time[0], labels["conditions"], view)
        as_read = AsRead(sha256, b"", regular.half_digit, factors=factors, interpolated=own.resample_hz is not None)
        trials.append(_made(columns, time, as_read, **fields_of))
    return trials


def _as_recorded(path: Path, own: Columns | None, schema: RigSchema, kind: str, inputs_only: bool, view: View) -> Table:
    """The rig's columns of one file, sample by sample; of several sources none has them all."""
    if own is None:
        return read_csv_or_hint(path)
    return own.taken(path, schema, kind, inputs_only or bool(view.derive) or view.is_joined, view.also)


def _conditions_of(place: int, later_s: float, stated: Mapping[str, float], view: View) -> dict[str, float]:
    """Conditions of a part of a recording: of its later parts nothing states where they begin."""
    kept = {n: v for n, v in stated.items() if not place or n not in OF_THE_START}
    if place and BEGAN in kept:
        if view.split == RESTARTS:  # how long the pause was nobody recorded
            del kept[BEGAN]
        else:
            kept[BEGAN] += later_s
    return kept


def _made(columns: Mapping[str, np.ndarray], time: np.ndarray, as_read: AsRead, **labels: Any) -> Trial:
    """A trial of what the reader of its file has checked."""
    made = object.__new__(Trial)
    made.__setstate__({**labels, "time": time.copy(), "columns": {n: v.copy() for n, v in columns.items()}})
    vars(made)["as_read"] = replace(as_read, digest=made.digest())
    return made


def _checked_columns(
    table: Table, schema: RigSchema, kind: str, inputs_only: bool
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """A trial's columns by name, and its time, after all that is asked of them was checked."""
    if table.names[0] != "time_s":
        raise table.error(f"expected time_s as the first column, found {table.names[0][:40]!r}; {NEW_STUDY}", "time_s")
    check_columns(table.names[1:], schema, kind, inputs_only, table.error)
    if len(again := restarts(table.time)):
        hint = f'split = "{RESTARTS}" in its [[trial]] makes {len(again) + 1} trials of it'
        raise table.error(f"expected time to increase, it starts again; {hint}", "time_s", int(again[0]))
    if len(gaps := holes(table.time)) and (np.diff(table.time) > 0.0).all():
        step, found = float(np.median(np.diff(table.time))), float(table.time[gaps[0]] - table.time[gaps[0] - 1])
        hint = f'split = "{HOLES}" in its [[trial]] makes {len(gaps) + 1} trials of it, and rate bridges short ones'
        message = f"expected a fixed step of {step:.6g} s within 1 %, found a hole of {found:.6g} s; {hint}"
        raise table.error(message, "time_s", int(gaps[0]))
    check_time(table)
    columns = {name: table.columns[name] for name in table.names[1:]}
    check_values(columns, schema, table.error, -math.inf)  # a study with its threshold judges widths
    return columns, table.time


def _body_columns(path: Path, inputs_only: bool) -> tuple[dict[str, np.ndarray], np.ndarray]:
    table, in_degrees = read_motion(path)
    columns = coordinates_of(table, in_degrees)
    if not inputs_only or "r_Fx" in table.names:
        columns |= ground_reaction_of(table)
    return columns, table.time


def read_body_trial(
    coordinates: Path,
    ground_reaction: Path,
    view: View | None = None,
    *,
    name: str,
    conditions: Mapping[str, float],
    conventions: Mapping[str, Any] | None = None,
    mass_kg: float | None = None,
    **labels: Any,
) -> Trial:
    """Read a walking trial from its two files, on the coordinates' times; `labels` are further fields of it.

    Of a view its two ends are taken. Conventions that are not stated are tested: see `data.walk_conventions`. Its
    remarks say which were taken.

    Raises
    ------
    InputError
        As `read_coordinates`, `read_ground_reaction`; the two were not recorded at the same time.
    """
    with hashing() as sha256:
        moves, in_degrees = read_motion(coordinates)
        pushes, _ = read_motion(ground_reaction)
    if view is not None:
        (moves,), (pushes,) = view.parts(moves, ()), view.parts(pushes, ())
    raw, plates, degrees = named_coordinates(moves), plates_in(pushes), stated_degrees(moves, in_degrees)
    with errors_of(ground_reaction):
        placed, pushed, said = conventional(moves.time, raw, degrees, pushes.time, plates, conventions, mass_kg)
    recordings = ((moves.time, placed), (pushes.time, pushed))
    time, columns = on_common_time(*recordings[0], *recordings[1])
    if len(time) < MIN_ROWS:
        message = f"expected at least {MIN_ROWS} samples in the time of {coordinates.name}, found {len(time)}"
        raise pushes.error(message, pushes.names[0], 0)
    as_read = AsRead(sha256, b"", recordings=recordings, stated=frozenset(conventions or ()))
    labels["remarks"] = (*labels.get("remarks", ()), *moves.said, *pushes.said, *said)
    return _made(columns, time, as_read, name=name, kind="motion", conditions=conditions, **labels)


def walk_recordings(trial: Trial) -> tuple[tuple[np.ndarray, Mapping[str, np.ndarray]], ...]:
    """Times and columns of a walk's coordinates and of its ground reaction.

    Each is at its own rate where the trial is as it was read, else on the times of the trial.
    """
    if trial.as_read is not None and trial.as_read.recordings and not trial.is_edited:
        return trial.as_read.recordings
    moves = {name: values for name, values in trial.columns.items() if name not in GROUND_REACTION}
    return (trial.time, moves), (trial.time, {name: trial[name] for name in GROUND_REACTION})


def write_trial(trial: Trial, path: str | Path, *, overwrite: bool = False) -> None:
    """Write a trial's time and columns as CSV, whole or not at all; reading gives the same numbers.

    Parameters
    ----------
    overwrite
        Replace a file that this function did not write, or that was changed since.

    Raises
    ------
    InputError
        If the file cannot be written, was read, is one of others, or could not be read again: a trial with samples
        that nobody measured.
    """
    text = trial_csv(replace(instance(trial, Trial, "trial"), as_read=None))  # which checks it by itself
    written_by("write_trial", path, text, (".csv",), overwrite)


def trial_csv(trial: Trial) -> str:
    """CSV text of a trial's time and columns."""
    return format_csv({"time_s": trial.time, **trial.columns})
