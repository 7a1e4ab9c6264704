"""Sheets of a spreadsheet as lines of text: the values that their cells store, whatever these show.

A sheet is then read as any text file is: titles above its header, a row of units, times of a clock.
"""

from __future__ import annotations

import datetime
import io
from functools import lru_cache
from pathlib import Path
from typing import Any

from fes_pin.data.errors import InputError, listed, optional_library
from fes_pin.data.files import read_bytes, read_text

SPREADSHEETS = (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods")
"""Suffixes of spreadsheets."""


def is_spreadsheet(path: Path) -> bool:
    """Return whether a file is a spreadsheet, by its suffix."""
    return path.suffix.lower() in SPREADSHEETS


def sheets_of(path: Path) -> tuple[str, ...]:
    """Names of the sheets of a spreadsheet, in its order.

    Raises
    ------
    InputError
        No spreadsheet, or python-calamine is not installed.
    """
    return tuple(_workbook(path, read_bytes(path)).sheet_names)


def lines_in(path: Path, encoding: str, delimiter: str, sheet: str) -> list[str]:
    """Lines of a text file, or of a sheet of a spreadsheet: its rows, as a text with this delimiter; "" is the first.

    Raises
    ------
    InputError
        As `read_text` and `sheets_of`; a sheet that is not there, or is stated of a file that has none.
    """
    if not is_spreadsheet(path):
        if sheet:
            raise InputError("expected a spreadsheet, which has sheets", file=path, column="sheet")
        return read_text(path, encoding).split("\n")
    names = sheets_of(path)
    sheet = sheet or names[0]
    if sheet not in names:
        raise InputError(
            f"expected one of its sheets, {listed(names)}; found {sheet[:40]!r}", file=path, column="sheet"
        )
    return [delimiter.join(_text(cell, delimiter) for cell in row) for row in _rows(path, read_bytes(path), sheet)]


def _workbook(path: Path, content: bytes) -> Any:
    needed = f"{path.suffix} files need python-calamine"
    library = optional_library("python_calamine", "spreadsheet", needed, file=path)
    try:
        return library.CalamineWorkbook.from_filelike(io.BytesIO(content))
    except Exception as error:
        reason = " ".join(str(error).split())[:120]
        raise InputError(f"cannot be read as a spreadsheet: {reason}", file=path) from None


@lru_cache(maxsize=2)
def _rows(path: Path, content: bytes, sheet: str) -> list[list[Any]]:
    """The cells of a sheet by rows, the first of which is row 1."""
    return list(_workbook(path, content).get_sheet_by_name(sheet).to_python(skip_empty_area=False))


def _text(cell: Any, delimiter: str) -> str:
    """What a cell stores, as text in one cell of a line."""
    if isinstance(cell, float):
        return str(int(cell)) if cell.is_integer() else repr(cell)
    if isinstance(cell, datetime.timedelta):
        return repr(cell.total_seconds())
    if isinstance(cell, datetime.datetime):
        return cell.isoformat(sep=" ")
    words = " ".join(str(int(cell) if isinstance(cell, bool) else cell).replace('"', "").split())
    return f'"{words}"' if delimiter in words else words
