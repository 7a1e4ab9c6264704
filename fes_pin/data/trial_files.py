"""Trials from files and to files: one file, a view of several, a walk in two."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fes_pin.data.as_read import AsRead, hashing
from fes_pin.data.checks import check_columns, check_values, checked_labels, checked_mapping
from fes_pin.data.errors import as_text, errors_of, fault_at
from fes_pin.data.files import as_path
from fes_pin.data.motion import (
    GROUND_REACTION,
    coordinates_of,
    ground_reaction_of,
    named_coordinates,
    on_common_time,
    plates_in,
    read_motion,
    renamed_coordinates,
    stated_degrees,
)
from fes_pin.data.numbers import instance
from fes_pin.data.outputs import written_by
from fes_pin.data.recorded.columns import Columns
from fes_pin.data.recorded.parts import HOLES, RESTARTS, holes, restarts
from fes_pin.data.recorded.sniff import NEW_STUDY, read_csv_or_hint
from fes_pin.data.recorded.view import View, joined
from fes_pin.data.schema import (
    RigSchema,
    check_conditions,
    schema_of,
)
from fes_pin.data.table import MIN_ROWS, Table, check_time, format_csv
from fes_pin.data.trial import BEGAN, OF_THE_START, Trial
from fes_pin.data.walk_conventions import conventional


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
    own = replace(own, form=replace(own.form, sheet=view.sheet or own.form.sheet))
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
    labels["remarks"] = (*labels.get("remarks", ()), *moves.said, *renamed_coordinates(moves), *pushes.said, *said)
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
