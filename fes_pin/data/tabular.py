"""Tables out: CSV, or Parquet by the suffix of the file, where pyarrow is installed."""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fes_pin.data.errors import optional_library
from fes_pin.data.outputs import check_ending

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
