"""A trial: one recording or one simulation, the same type, so that their residual is a subtraction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.files import write_text
from fes_pin.data.motion import coordinates_of, ground_reaction_of, on_common_time, read_motion
from fes_pin.data.recorded.columns import Columns
from fes_pin.data.recorded.hint import read_csv_or_hint
from fes_pin.data.schema import (
    ROLES,
    RigSchema,
    check_conditions,
    one_of,
    schema_of,
)
from fes_pin.data.show import frame
from fes_pin.data.table import MIN_ROWS, format_csv
from fes_pin.data.trial_columns import checked_columns

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True, eq=False, repr=False)
class Trial:
    """One recording or one simulation.

    Parameters
    ----------
    name
        Of the trial within its study, e.g. the stem of its file.
    kind
        "motion", "isometric" or "imposed".
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

    Raises
    ------
    ValueError
        A column that is not as long as the time.
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

    def __post_init__(self) -> None:
        time = _frozen(self.time)
        columns = {name: _frozen(values) for name, values in self.columns.items()}
        for name, values in columns.items():
            if values.shape != time.shape or time.ndim != 1:
                raise ValueError(f"column {name} has shape {values.shape}, the time {time.shape}; expected (n,)")
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "columns", MappingProxyType(columns))
        object.__setattr__(self, "conditions", MappingProxyType(dict(self.conditions)))

    def __reduce__(self) -> tuple[Any, ...]:
        return Trial, (
            self.name,
            self.kind,
            dict(self.columns),
            self.time,
            dict(self.conditions),
            self.role,
            self.group,
            self.remarks,
            self.low_pass_hz,
        )

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, column: str) -> np.ndarray:
        try:
            return self.columns[column]
        except KeyError:
            raise KeyError(f"trial {self.name} has no column {column!r}; it has {', '.join(self.columns)}") from None

    def __contains__(self, column: object) -> bool:
        return column in self.columns

    @cached_property
    def dt(self) -> float:
        """Time step, s: the mean one, which printing rounds less than any single one."""
        return float(self.time[-1] - self.time[0]) / (len(self) - 1)

    @property
    def duration(self) -> float:
        """Time from the first to the last sample, s."""
        return float(self.time[-1] - self.time[0])

    def first(self, count: int) -> Trial:
        """The trial's first samples, itself if it has no more than `count`."""
        if count >= len(self):
            return self
        columns = {n: v[:count] for n, v in self.columns.items()}
        return replace(self, columns=columns, time=self.time[:count])

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
        return replace(self, columns={name: self.columns[name] for name in self.columns if name not in columns})

    def residual(self, simulated: Trial, column: str) -> np.ndarray:
        """This trial, measured, minus a simulated one, in one column.

        Returns
        -------
        ndarray, shape (n,)

        Raises
        ------
        KeyError
            If either has no such column.
        ValueError
            If they were not sampled at the same times.
        """
        if len(self) != len(simulated) or not np.allclose(self.time, simulated.time, rtol=0.0, atol=1e-3 * self.dt):
            raise ValueError(f"trials {self.name} and {simulated.name} were not sampled at the same times")
        return self[column] - simulated[column]

    def __repr__(self) -> str:
        conditions = "".join(f", {name} = {value:g}" for name, value in self.conditions.items())
        rate = f", {self.duration:.4g} s at {1.0 / self.dt:.4g} Hz" if len(self) > 1 else ""
        columns = ", ".join(self.columns)
        role = f", {self.role}" if self.role else ""
        return f"Trial {self.name} ({self.kind}{role}): {len(self)} samples{rate}{conditions}; {columns}"

    def to_frame(self) -> pandas.DataFrame:
        """Every column against `time_s` as a frame of pandas; see `data.show.frame`."""
        return frame({"time_s": self.time, **self.columns}, index="time_s")


def _frozen(values: Any) -> np.ndarray:
    array = np.array(values, dtype=float)
    array.setflags(write=False)
    return array


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
    conditions, role, group
        As a `[[trial]]` table gives them.
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
    path = Path(path)

    def error(key: str, message: str) -> InputError:
        return InputError(message, file=path, column=key)

    try:
        schema = schema_of(rig)
    except ValueError as problem:
        raise error("rig", str(problem)) from None
    kind = checked_kind(schema, kind, error)
    if role is not None:
        _checked("role", role, ROLES, error)
    numbers = check_conditions(schema, kind, conditions or {}, error)
    if len(schema.recordings) > 1:
        columns, time = _body_columns(path, inputs_only)
        return Trial(name or path.stem, kind, columns, time, numbers, role, group)
    table, said = (read_csv_or_hint(path), "") if own is None else own.read(path, schema, kind, inputs_only)
    columns, time = checked_columns(table, schema, kind, inputs_only)
    return Trial(name or path.stem, kind, columns, time, numbers, role, group, (said,) if said else ())


def checked_kind(schema: RigSchema, kind: object, error: Callable[[str, str], InputError]) -> str:
    """The kind of a trial of this rig; the rig's default if it names none.

    Raises
    ------
    InputError
        Made by `error` from the key and a message, for a kind that the rig does not have.
    """
    if kind is None:
        return schema.default_kind
    if not isinstance(kind, str) or kind not in schema.outputs:
        found = f"{kind[:40]!r}" if isinstance(kind, str) else f"a {type(kind).__name__}"
        expected = f"{'one of ' if len(schema.outputs) > 1 else ''}{', '.join(schema.outputs)}"
        raise error("kind", f"expected {expected} for rig {schema.name}, found {found}")
    return kind


def _checked(key: str, value: object, known: tuple[str, ...], error: Callable[[str, str], InputError]) -> str:
    try:
        return one_of(value, known)
    except ValueError as problem:
        raise error(key, str(problem)) from None


def _body_columns(path: Path, inputs_only: bool) -> tuple[dict[str, np.ndarray], np.ndarray]:
    table, in_degrees = read_motion(path)
    columns = coordinates_of(table, in_degrees)
    if not inputs_only or "r_Fx" in table.names:
        columns |= ground_reaction_of(table)
    return columns, table.values[:, 0]


def read_body_trial(
    coordinates: Path,
    ground_reaction: Path,
    *,
    name: str,
    conditions: Mapping[str, float],
    role: str | None,
    group: str | None = None,
) -> Trial:
    """Read a walking trial from its two files, on the coordinates' times.

    Raises
    ------
    InputError
        As `read_coordinates`, `read_ground_reaction`; the two were not recorded at the same time.
    """
    moves, in_degrees = read_motion(coordinates)
    pushes, _ = read_motion(ground_reaction)
    time, columns = on_common_time(
        moves.values[:, 0], coordinates_of(moves, in_degrees), pushes.values[:, 0], ground_reaction_of(pushes)
    )
    if len(time) < MIN_ROWS:
        message = f"expected at least {MIN_ROWS} samples in the time of {coordinates.name}, found {len(time)}"
        raise pushes.error(message, pushes.names[0], 0)
    return Trial(name, "motion", columns, time, conditions, role, group)


def write_trial(trial: Trial, path: str | Path) -> None:
    """Write a trial's time and columns as CSV, whole or not at all; reading gives the same numbers.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    write_text(path, trial_csv(trial))


def trial_csv(trial: Trial, columns: tuple[str, ...] | None = None) -> str:
    """CSV text of a trial's time and all or some of its columns."""
    names = trial.columns if columns is None else columns
    return format_csv({"time_s": trial.time, **{name: trial[name] for name in names}})
