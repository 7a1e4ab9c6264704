"""Numbers by named column, with what is asked of their times; tables of the package, and tables that are written.

These are CSV, or Parquet by the suffix of the file, where pyarrow is installed.
"""

import csv
import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fes_pin.data.errors import InputError, optional_library
from fes_pin.data.outputs import check_ending

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
    """Columns of numbers by name, with the place that each row has in its file.

    Parameters
    ----------
    path
        The file.
    names
        Names of all of its columns, in its order; the time first where it is known which that is.
    columns
        Numbers of those that were asked for, each of shape (n,); NaN where a sample is missing.
    rows : ndarray of int, shape (n,)
        Where each sample stands: its line in a text file, else its number from 1.
    header_row
        Line number of the names; 0 where there is none.
    units
        Units as the file itself states them, by name, where it does.
    half_digit
        Half of the last digit that times were printed with, s; None: as the times themselves show.
    half_digit_of
        The same of any column by its name, in its unit; 0 where numbers are not printed.
    called
        The file's own names of columns that have other ones here.
    said
        What its reader assumed, changed or left out, a sentence each; they become remarks of the trial.
    """

    path: Path
    names: tuple[str, ...]
    columns: Mapping[str, np.ndarray]
    rows: np.ndarray
    header_row: int = 0
    units: Mapping[str, str] = field(default_factory=dict)
    half_digit: float | None = None
    half_digit_of: Callable[[str], float] = lambda _name: 0.0
    called: Mapping[str, str] = field(default_factory=dict)
    said: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def time(self) -> np.ndarray:
        """The first column, shape (n,)."""
        return self.columns[self.names[0]]

    def error(self, message: str, column: str, sample: int | None = None) -> InputError:
        """The error that names this file, a sample's row (or the header's) and a column."""
        row = (self.header_row or None) if sample is None else int(self.rows[sample])
        called = self.called.get(column, column)
        place = column if called == column else f"{called} ({column})"
        return InputError(message, file=self.path, row=row, column=place)


def check_time(table: Table) -> None:
    """Require the first column to increase in equal steps; see `check_times`."""
    hint = "; resample_hz in [columns.file] has the samples interpolated"
    check_times(table.time, table.error, table.names[0], table.half_digit, hint)


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


def increasing_steps(table: Table) -> np.ndarray:
    """The steps of a table's times, s, shape (n - 1,).

    Raises
    ------
    InputError
        One is not above 0, with its row.
    """
    steps = np.diff(table.time)
    if not (steps > 0.0).all():
        raise table.error("expected time to increase", "time_s", int(np.argmin(steps > 0.0)) + 1)
    return steps


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


def format_csv(columns: Mapping[str, np.ndarray], form: Callable[[float], str] = repr) -> str:
    """CSV text of equally long columns; each number is the shortest text that reads back as it, or as `form` has it."""
    rows = zip(*(map(form, np.asarray(values, dtype=float).tolist()) for values in columns.values()), strict=True)
    return "\n".join([",".join(columns), *map(",".join, rows)]) + "\n"


def own_table(path: Path) -> list[dict[str, str]]:
    """Rows of a table that comes with the package; lines that begin with # say what is in it."""
    lines = path.read_text("utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


SUFFIXES = (".csv", ".parquet")


def check_table(path: str | Path) -> None:
    """Raise where `table_bytes` would, before the work that makes the table.

    Raises
    ------
    InputError
        A suffix that is none of `SUFFIXES`; Parquet without pyarrow.
    """
    check_ending(path, SUFFIXES)
    if Path(path).suffix.lower() == ".parquet":
        optional_library("pyarrow.parquet", "parquet", "Parquet needs pyarrow", file=path)


def table_bytes(columns: Mapping[str, Sequence[Any] | np.ndarray], path: str | Path) -> bytes:
    """A table as the file's suffix says.

    Parameters
    ----------
    columns
        Numbers as an array of shape (n,), or a list of n numbers, words, or truths; None and NaN are written as
        nothing.

    Raises
    ------
    InputError
        As `check_table`.
    """
    check_table(path)
    cells = {n: v.astype(float).tolist() if isinstance(v, np.ndarray) else v for n, v in columns.items()}
    if Path(path).suffix.lower() == ".parquet":
        import pyarrow  # noqa: PLC0415
        from pyarrow.parquet import write_table  # noqa: PLC0415

        kinds = {bool: pyarrow.bool_(), int: pyarrow.int64(), float: pyarrow.float64(), str: pyarrow.string()}
        known = {n: next((type(x) for x in v if x is not None), str) for n, v in cells.items()}
        sink = io.BytesIO()
        made = {n: pyarrow.array(v, kinds[known[n]], from_pandas=True) for n, v in cells.items()}
        write_table(pyarrow.table(made), sink)
        return sink.getvalue()
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(cells)
    writer.writerows(zip(*(["" if _is_unknown(x) else x for x in v] for v in cells.values()), strict=True))
    return stream.getvalue().encode()


def _is_unknown(value: Any) -> bool:
    return value is None or (isinstance(value, float) and math.isnan(value))
