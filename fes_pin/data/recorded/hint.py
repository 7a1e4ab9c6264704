"""Errors for files that are not written as the study format says; the message names what reads them as they are."""

from __future__ import annotations

from pathlib import Path

from fes_pin.data.errors import InputError
from fes_pin.data.recorded.formats import check_suffix, is_text
from fes_pin.data.recorded.sniff import sniff
from fes_pin.data.recorded.text import read_csv
from fes_pin.data.table import Table

NEW_STUDY = "`fes-pin new-study` writes a [columns] table that reads it as it is"


def read_csv_or_hint(path: str | Path) -> Table:
    """As `read_csv`; where that fails and the file seems to be written otherwise, the error says how.

    Raises
    ------
    InputError
        As `read_csv`.
    """
    path = Path(path)
    check_suffix(path)
    if not is_text(path):
        raise InputError(f"expected CSV, found {path.suffix}; {NEW_STUDY}", file=path)
    try:
        return read_csv(path)
    except InputError as error:
        hint = _hint(path)
        if not hint:
            raise
        message = f"{error.message}; {hint}"
        raise InputError(message, file=error.file, row=error.row, column=error.column) from None


def _hint(path: Path) -> str:
    try:
        form, _ = sniff(path)
    except InputError:
        return ""
    words = form.in_words()
    return f"it seems to have {words}: {NEW_STUDY}" if words else ""
