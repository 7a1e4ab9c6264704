"""A trial: one recording or one simulation, the same type, so that their residual is a subtraction."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from fes_pin.data.as_read import AsRead, digest_of
from fes_pin.data.checks import check_columns, check_values, checked_label, checked_labels, checked_mapping
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import instance
from fes_pin.data.read_only import ReadOnly
from fes_pin.data.schema import (
    NumberKey,
    RigSchema,
    check_conditions,
    checked_numbers,
    number_or_none,
)
from fes_pin.data.show import DataFrame, frame
from fes_pin.data.table import MIN_ROWS, check_times

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
        """The error that names a column, the file that it was read from, this trial and a sample."""
        place = f"trial {self.name}" + ("" if sample is None else f", sample {sample}")
        file = self.as_read.file_of(column) if self.as_read is not None and column in self.columns else None
        return InputError(f"{message} ({place})", file=file, column=column)

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
