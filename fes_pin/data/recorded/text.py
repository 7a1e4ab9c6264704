"""Text files of numbers in whatever form an instrument writes them: delimiter, decimal comma, units rows, comments."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.files import read_bytes
from fes_pin.data.recorded.recording import Recording, without_twins
from fes_pin.data.table import MIN_ROWS, number_of_cell

DELIMITERS = (";", "\t", ",", " ")
"""Semicolon, tab, comma, and any white space."""
DECIMALS = (".", ",")
ENCODINGS = ("utf-8", "utf-16", "cp1252")
MISSING = frozenset({"", "nan", "na", "n/a", "-", "--", "null", "none", "#n/a"})
"""What instruments write where there is no sample, in lower case."""


@dataclass(frozen=True)
class TextForm:
    """How a text file writes its numbers.

    Parameters
    ----------
    delimiter
        Of `DELIMITERS`.
    decimal
        "." or ",".
    header_row
        Line of the column names, from 1; 0 if the file has none, and columns are then called column1, column2 ...
    first_row
        Line of the first numbers; what stands between it and the header (a row of units) is passed over.
    comment
        What a line begins with that is passed over; "" for nothing.
    encoding
        Of `ENCODINGS`.
    """

    delimiter: str = ","
    decimal: str = "."
    header_row: int = 1
    first_row: int = 2
    comment: str = ""
    encoding: str = "utf-8"

    def in_words(self) -> str:
        """What sets this form apart from that of the study format; "" if nothing does."""
        plain, said = TextForm(), []
        if self.delimiter != plain.delimiter:
            said.append({";": "semicolons", "\t": "tabs", " ": "white space"}[self.delimiter] + " between values")
        if self.decimal != plain.decimal:
            said.append("decimal commas")
        if self.header_row == 0:
            said.append("no header")
        elif self.header_row > 1:
            said.append(f"a header in row {self.header_row}")
        if self.header_row and self.first_row > self.header_row + 1:
            said.append("a row of units")
        if self.comment:
            said.append(f"comments after {self.comment}")
        if self.encoding != plain.encoding:
            said.append(f"{self.encoding} text")
        return ", ".join(said)


def lines_of(path: Path, encoding: str) -> list[str]:
    """Lines of a text file.

    Raises
    ------
    InputError
        As `read_bytes`, and for bytes that are no text of this encoding, with the row.
    """
    content = read_bytes(path)
    try:
        text = content.decode("utf-8-sig" if encoding == "utf-8" else encoding)
    except UnicodeError as error:
        row = content[: getattr(error, "start", 0)].count(b"\n") + 1
        raise InputError(f"expected {encoding} text", file=path, row=row) from None
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def cells_of(line: str, delimiter: str) -> list[str]:
    """The cells of one line, without quotes and surrounding spaces; a delimiter at its end begins no cell."""
    if delimiter == " ":
        return [cell.strip('"') for cell in line.split()]
    cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), []) if '"' in line else None
    out = [cell.strip() for cell in (line.split(delimiter) if cells is None else cells)]
    return out[:-1] if len(out) > 1 and not out[-1] else out


def read_text_recording(path: Path, form: TextForm, wanted: Sequence[str] | None = None) -> Recording:
    """Read some columns of a text file, or all.

    Parameters
    ----------
    wanted
        Names of the columns whose cells must be numbers; None for all.

    Raises
    ------
    InputError
        A file that is not of this form, with row and column.
    """
    lines = lines_of(path, form.encoding)
    names = _names(path, lines, form)
    chosen = [n for n in names if wanted is None or n in wanted]
    body, rows = _body(lines, form)
    if len(body) < MIN_ROWS:
        message = f"expected at least {MIN_ROWS} rows of numbers from row {form.first_row} on, found {len(body)}"
        raise InputError(message, file=path, row=form.first_row)
    places = [names.index(n) for n in chosen]
    values = _fast(body, form, places, len(names))
    if values is None:
        values = _slowly(path, body, rows, form, (names, places))
    columns = dict(zip(chosen, values.T.copy(), strict=True))

    def half_digit(name: str) -> float:
        place = names.index(name)
        texts = (cells_of(line, form.delimiter) for line in body)
        return 0.5 * 10.0 ** -max(_decimals(cells[place], form.decimal) for cells in texts if place < len(cells))

    return Recording(path, names, columns, rows, form.header_row or None, {}, None, half_digit)


def _names(path: Path, lines: list[str], form: TextForm) -> tuple[str, ...]:
    if form.header_row:
        if form.header_row > len(lines) or not lines[form.header_row - 1].strip():
            raise InputError("expected column names here, found nothing", file=path, row=form.header_row)
        line = lines[form.header_row - 1]
        return without_twins(cells_of(line.removeprefix(form.comment) if form.comment else line, form.delimiter))
    first = next((line for line in lines[form.first_row - 1 :] if line.strip()), "")
    return without_twins([""] * len(cells_of(first, form.delimiter)))


def _body(lines: list[str], form: TextForm) -> tuple[list[str], np.ndarray]:
    """The lines of numbers, and where each stands."""
    body, rows = [], []
    for row, line in enumerate(lines[form.first_row - 1 :], form.first_row):
        if line.strip() and not (form.comment and line.lstrip().startswith(form.comment)):
            body.append(line)
            rows.append(row)
    return body, np.array(rows, dtype=int)


def _fast(body: list[str], form: TextForm, places: list[int], count: int) -> np.ndarray | None:
    """All numbers at once; None where something in the file must be looked at cell by cell."""
    odd = '".' if form.decimal == "," else '"'  # a point among decimal commas may part thousands
    if any(sign in line for line in body for sign in odd):
        return None
    if form.delimiter != " ":
        cuts = {line.count(form.delimiter) for line in body}
        if not cuts <= {count - 1, count} or len(cuts) > 1:
            return None
    elif any(len(line.split()) != count for line in body):
        return None
    lines = [line.replace(",", ".") for line in body] if form.decimal == "," else body
    delimiter = None if form.delimiter == " " else form.delimiter
    try:
        values = np.loadtxt(lines, dtype=float, delimiter=delimiter, comments=None, ndmin=2, usecols=places)
    except ValueError:
        return None
    return None if np.isinf(values).any() else values


def _slowly(
    path: Path, body: list[str], rows: np.ndarray, form: TextForm, which: tuple[tuple[str, ...], list[int]]
) -> np.ndarray:
    names, places = which
    values = np.empty((len(body), len(places)))
    for index, line in enumerate(body):
        cells = cells_of(line, form.delimiter)
        row = int(rows[index])
        if len(cells) > len(names):
            message = f"expected {len(names)} values as in the header, found {len(cells)}"
            raise InputError(message, file=path, row=row, column=names[-1])
        for k, place in enumerate(places):
            cell = cells[place] if place < len(cells) else ""
            is_missing = cell.lower() in MISSING
            values[index, k] = np.nan if is_missing else number_of_cell(cell, path, row, names[place], form.decimal)
    return values


def _decimals(cell: str, decimal: str) -> int:
    """How many digits stand after the decimal sign, an exponent counted in."""
    mantissa, _, exponent = cell.lower().partition("e")
    digits = len(mantissa.partition(decimal)[2].strip())
    return digits - (int(exponent) if exponent.lstrip("+-").isdigit() else 0)
