"""Tables out: Parquet by the suffix of the file, where pyarrow is installed; else CSV."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.table import format_csv

SUFFIXES = (".csv", ".parquet")


def check_table(path: str | Path) -> None:
    """Raise where `table_bytes` would, before the work that makes the table.

    Raises
    ------
    InputError
        Parquet without pyarrow.
    """
    if Path(path).suffix.lower() == ".parquet":
        try:
            import pyarrow.parquet  # noqa: F401, PLC0415
        except ImportError:
            raise InputError("Parquet needs pyarrow: pip install 'fes-pin[parquet]'", file=path) from None


def table_bytes(
    columns: Mapping[str, np.ndarray], path: str | Path, names: Mapping[str, Sequence[str]] | None = None
) -> bytes:
    """A table as the file's suffix says.

    Parameters
    ----------
    columns
        Numbers, each of shape (n,); NaN is written as nothing.
    names
        Columns of words, which come first.

    Raises
    ------
    InputError
        As `check_table`.
    """
    check_table(path)
    if Path(path).suffix.lower() == ".parquet":
        import pyarrow  # noqa: PLC0415
        from pyarrow.parquet import write_table  # noqa: PLC0415

        first = {n: list(v) for n, v in (names or {}).items()}
        numbers = {n: pyarrow.array(np.asarray(v, dtype=float), from_pandas=True) for n, v in columns.items()}
        stream = io.BytesIO()
        write_table(pyarrow.table({**first, **numbers}), stream)
        return stream.getvalue()
    lines = format_csv(columns).replace("nan", "").split("\n")
    if names:
        words = [",".join(names), *(",".join(map(_quoted, row)) for row in zip(*names.values(), strict=True))]
        lines = [f"{word},{line}" for word, line in zip(words, lines[:-1], strict=True)] + [""]
    return "\n".join(lines).encode()


def _quoted(word: str) -> str:
    """A word as a cell of CSV."""
    escaped = word.replace('"', '""')
    return f'"{escaped}"' if {",", '"'} & set(word) else word
