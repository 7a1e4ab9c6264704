"""Numbers by named column: CSV read fast when it is clean, and slowly to say where it is not."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.files import read_text

MIN_ROWS = 3
STEP_TOLERANCE = 0.01  # a step may vary by 1 %
MOST_DECIMALS = 9
"""Nanoseconds: times that are printed with more decimals are as exact as any."""
CLOSE = 1e-3
"""Share of a decimal by which times may miss it: what is taken off them costs their last digits."""
Fault = Callable[[str, str, int | None], InputError]
"""Makes the error of a message, a column, and a sample or None: a table names its file and row, a trial itself."""


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of finite numbers, with the place that each row had in its file.

    Parameters
    ----------
    path
        The file.
    names
        Column names, time first.
    values : ndarray, shape (n, m)
        The numbers.
    header_row
        Line number of the header; the first numbers stand in the next line.
    delimiter
        What separates the values of a row; None is white space.
    rows, half_digit, called
        Where a file is read as its study's `[columns]` says: the place of each sample, shape (n,); half of the last
        digit that times were printed with, s; the file's own names of its columns.
    """

    path: Path
    names: tuple[str, ...]
    values: np.ndarray
    header_row: int
    delimiter: str | None
    rows: np.ndarray | None = None
    half_digit: float | None = None
    called: Mapping[str, str] = field(default_factory=dict)

    def row(self, sample: int) -> int:
        """Line number of a sample."""
        return self.header_row + 1 + int(sample) if self.rows is None else int(self.rows[sample])

    def column(self, name: str) -> np.ndarray:
        """One column, shape (n,)."""
        return self.values[:, self.names.index(name)]

    def error(self, message: str, column: str, sample: int | None = None) -> InputError:
        """The error that names this file, a sample's row (or the header's) and a column."""
        row = (self.header_row or None) if sample is None else self.row(sample)
        called = self.called.get(column, column)
        return InputError(
            message, file=self.path, row=row, column=column if called == column else f"{called} ({column})"
        )


def read_csv(path: str | Path) -> Table:
    """Read comma-separated numbers under one header row.

    Raises
    ------
    InputError
        No header, a duplicated or nameless column, fewer than 3 rows, a ragged row, text or nothing where a number
        belongs, a number that is not finite: with its row and column.
    """
    path = Path(path)
    lines = read_text(path).split("\n")
    if not lines[0].strip():
        raise InputError("expected a header row of column names, found nothing", file=path, row=1)
    names = tuple(name.strip().strip('"') for name in lines[0].split(","))
    return parse_rows(path, names, lines[1:], header_row=1, delimiter=",")


def parse_rows(path: Path, names: tuple[str, ...], lines: list[str], header_row: int, delimiter: str | None) -> Table:
    """Numbers of the lines beneath a header; `delimiter` None stands for white space."""
    _check_names(path, names, header_row)
    while lines and not lines[-1].strip():
        lines.pop()
    if len(lines) < MIN_ROWS:
        found = f"expected at least {MIN_ROWS} rows of numbers, found {len(lines)}"
        raise InputError(found, file=path, row=header_row + len(lines), column=names[0])
    values = _parse_fast(lines, delimiter)
    if values is None or values.shape != (len(lines), len(names)) or not np.isfinite(values).all():
        values = _parse_slowly(path, names, lines, header_row, delimiter)
    return Table(path, names, values, header_row, delimiter)


def _check_names(path: Path, names: Sequence[str], header_row: int) -> None:
    for index, name in enumerate(names):
        if not name:
            raise InputError("expected a column name", file=path, row=header_row, column=f"#{index + 1}")
        if name in names[:index]:
            raise InputError("this column is there twice", file=path, row=header_row, column=name)


def _parse_fast(lines: list[str], delimiter: str | None) -> np.ndarray | None:
    try:
        return np.loadtxt(lines, dtype=float, delimiter=delimiter, comments=None, ndmin=2)
    except ValueError:
        return None


def _parse_slowly(
    path: Path, names: Sequence[str], lines: Sequence[str], header_row: int, delimiter: str | None
) -> np.ndarray:
    values = np.empty((len(lines), len(names)))
    for index, line in enumerate(lines):
        row = header_row + 1 + index
        if not line.strip():
            raise InputError("expected numbers, found an empty row", file=path, row=row, column=names[0])
        fields = line.split(delimiter)
        if len(fields) != len(names):
            at = names[min(len(fields), len(names) - 1)]
            message = f"expected {len(names)} values as in the header, found {len(fields)}"
            raise InputError(message, file=path, row=row, column=at)
        for place, (name, cell) in enumerate(zip(names, fields, strict=True)):
            values[index, place] = _number(cell, path, row, name)
    return values


def _number(field: str, path: Path, row: int, column: str) -> float:
    field = field.strip()
    if not field:
        raise InputError("expected a number, found nothing", file=path, row=row, column=column)
    return number_of_cell(field, path, row, column)


def number_of_cell(cell: str, path: Path, row: int, column: str, decimal: str = ".") -> float:
    """The finite number that a cell says with this decimal sign.

    Raises
    ------
    InputError
        It says none, with row and column.
    """
    try:
        if "_" in cell or (decimal == "," and "." in cell):
            raise ValueError
        value = float(cell.replace(decimal, "."))
    except ValueError:
        what = "a number with a decimal comma" if decimal == "," else "a number"
        raise InputError(f"expected {what}, found {cell[:40]!r}", file=path, row=row, column=column) from None
    if not math.isfinite(value):
        raise InputError(f"expected a finite number, found {cell[:40]!r}", file=path, row=row, column=column)
    return value


def check_time(table: Table) -> None:
    """Require the first column to increase in equal steps; see `check_times`."""
    hint = "; resample_hz in [columns.file] has the samples interpolated"
    check_times(table.values[:, 0], table.error, table.names[0], table.half_digit, hint)


def check_times(
    time: np.ndarray, error: Fault, name: str = "time_s", half_digit: float | None = None, hint: str = ""
) -> None:
    """Require times to increase in equal steps.

    A step may differ from the median step by 1 %. Where times were printed with few decimals (1/60 s as 0.017, 0.033,
    0.050), they must lie as rounding leaves them about equally spaced times: within half of the last digit, with the
    odd steps spread over the record. One odd step among equal ones is not rounding.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s.
    error, name
        Makes the error; the column that it names.
    half_digit
        Half of the last digit that times were printed with, s; None: as the times themselves show.
    hint
        What is said of a step that is another one.

    Raises
    ------
    InputError
        With the first sample that does not increase, or whose step is another one.
    """
    steps = np.diff(time)
    least, most = float(steps.min()), float(steps.max())
    if not least > 0.0:
        raise error("expected time to increase", name, int(np.argmax(~(steps > 0.0))) + 1)
    if most - least <= STEP_TOLERANCE * least:  # then each is within 1 % of the median, which takes longer
        return
    step = float(np.median(steps))
    if (np.abs(steps - step) <= STEP_TOLERANCE * step * (1 + 1e-6)).all():
        return
    late = _first_off_grid(time, steps, step, _half_digit(time) if half_digit is None else half_digit)
    if late is not None:
        found = f"expected a fixed step of {step:.6g} s within 1 %, found {steps[late - 1]:.6g} s"
        raise error(found + hint, name, late)


def _first_off_grid(time: np.ndarray, steps: np.ndarray, step: float, half_digit: float) -> int | None:
    """First sample that no equally spaced times, printed with this last digit, explain."""
    odd = np.abs(steps - step) > STEP_TOLERANCE * step
    off = odd & (np.abs(steps - step) > STEP_TOLERANCE * step + 2.0 * half_digit)
    if off.any() or np.count_nonzero(odd) < max(2.0, 0.02 * len(steps)):
        return int(np.argmax(off if off.any() else odd)) + 1
    count = np.arange(len(time), dtype=float)
    slope = float(np.dot(count - count.mean(), time - time.mean()) / np.sum((count - count.mean()) ** 2))
    residual = time - slope * count
    off = np.abs(residual - np.median(residual)) > 1.5 * half_digit
    if not off.any():
        return None
    return max(1, int(np.argmax(off))) if np.count_nonzero(odd) > 0.1 * len(steps) else int(np.argmax(odd)) + 1


def _half_digit(time: np.ndarray) -> float:
    """Half of the last decimal that any time has, s; 0 for more of them than any clock has."""
    places = range(MOST_DECIMALS + 1)
    decimals = (d for d in places if np.abs(time - np.round(time, d)).max() <= CLOSE * 10.0**-d)
    return 0.5 * 10.0 ** -next(decimals, math.inf)


def format_csv(columns: Mapping[str, np.ndarray]) -> str:
    """CSV text of equally long columns; each number is the shortest text that reads back as the same number."""
    rows = zip(*(map(repr, np.asarray(values, dtype=float).tolist()) for values in columns.values()), strict=True)
    return "\n".join([",".join(columns), *map(",".join, rows)]) + "\n"
