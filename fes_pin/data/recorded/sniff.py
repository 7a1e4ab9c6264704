"""What form a text file seems to have: its delimiter, its header, its first row of numbers.

The form is proposed to a person, or named by an error, and never used unseen.
"""

import operator
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from fes_pin.data.errors import InputError, listed
from fes_pin.data.files import as_path, read_bytes
from fes_pin.data.recorded.clock import clock_seconds
from fes_pin.data.recorded.form import COMMENTS, DECIMALS, DELIMITERS, MISSING, TextForm, cells_of
from fes_pin.data.recorded.formats import check_suffix, is_text
from fes_pin.data.recorded.header import NUMBER, Header, cells_in, header_of, is_keyed, ways
from fes_pin.data.recorded.labelled import names_before_numbers, why_no_names
from fes_pin.data.recorded.sheets import is_spreadsheet
from fes_pin.data.recorded.text import read_text_recording
from fes_pin.data.table import MIN_ROWS, Table

LOOKED_AT = 400
"""Lines that are looked at; no preamble of an instrument is nearly as long."""
NEW_STUDY = "`fes-pin new-study` writes a [columns] table that reads it as it is"
WIDE = 10
"""Columns for each row, at least, of a table that looks transposed; the one with the fewest rows that is read has 3."""
_NUMBER = {".": NUMBER, ",": re.compile(r"^[+-]?\d+(,\d+)?([eE][+-]?\d+)?$")}
Rows = list[tuple[int, list[bool]]]
"""Places of the rows of numbers, the last first, and of each cell whether it is a number."""


def sniffed(path: Path, stated: Mapping[str, Any] = MappingProxyType({})) -> tuple[TextForm, Header]:
    """The form that a text file seems to have, and what stands above its numbers.

    Parameters
    ----------
    stated
        What a person says of `TextForm`, by its keys.

    Raises
    ------
    InputError
        Not a text file, or no rows of numbers in it.
    """
    lines, rows, form = _likeliest(path, str(stated.get("sheet", "")))
    called = Header(names=form.names, said=_labels_in_words(form.names)) if form.labelled else None
    found = max(_first_of(lines, rows, form), int(stated.get("header_row", 0)))
    first = int(stated.get("first_row", found + 1)) - 1
    above = lines[:first]
    turned = None if "transposed" in stated or called else _transposed(above, rows, form)
    below = [place for place, _ in reversed(rows) if place >= first] or [rows[-1][0]]
    columns = len(rows[0][1])
    numbers = [(cells_of(lines[place], form) + [""] * columns)[:columns] for place in below[:2]]
    header = called or turned or (Header() if stated.get("transposed") else header_of(above, form, numbers))
    if not turned:
        header = replace(header, said=(*header.said, *_odd_of_table(header, above, form, (len(rows), columns))))
    if {"names", "header_row", "transposed"} & set(stated):
        header = Header(int(stated.get("header_row", header.row)), rate_hz=header.rate_hz)
    form = replace(form, header_row=header.row, names=header.names, transposed=turned is not None, first_row=first + 1)
    return replace(form, **stated), header


def _labels_in_words(names: Sequence[str]) -> tuple[str, ...]:
    return (f"its lines have names before their numbers: {listed([n for n in names if n])}",)


def _odd_of_table(header: Header, above: Sequence[str], form: TextForm, shape: tuple[int, int]) -> list[str]:
    """Sentences about a table of so many rows and columns that may be another than it seems."""
    count, columns = shape
    lost = [line for line in above if _begins_a_row(line) and len(cells_of(line, form)) == columns]
    if len(lost) >= MIN_ROWS and columns > 1:
        place = f"above line {len(above) + 1}"
        return [f"{len(lost)} lines of numbers {place} are not read: what stands between is taken as names"]
    if not header.row and not header.said and columns >= WIDE * count:
        return [f"{count} rows of {columns} columns without names: is the table transposed? --transposed says so"]
    return []


def _likeliest(path: Path, sheet: str) -> tuple[list[str], Rows, TextForm]:
    """The first lines of a file, its rows of numbers, and the form in which these are likeliest, without a header."""
    if is_spreadsheet(path):
        forms = [TextForm(sheet=sheet)]
    else:
        plain = TextForm(encoding=_encoding(path))
        looked_at = plain.lines(path)[:LOOKED_AT]
        if called := names_before_numbers(looked_at):
            plain = replace(plain, labelled=True, names=called)
        elif why := why_no_names(looked_at):
            raise InputError(why, file=path)
        forms = [replace(plain, delimiter=sign, decimal=point) for sign in DELIMITERS for point in DECIMALS]
    every = forms[0].lines(path)
    lines = _without_footer(_first_block(every[:LOOKED_AT]))
    rows, form = max(((_rows(lines, form), form) for form in forms), key=lambda pair: _likely(*pair))
    if not rows:
        raise InputError("expected rows of numbers, found none", file=path)
    if len(rows) > 1 and _counts(cells_of(lines[rows[-1][0]], form), every[rows[-1][0] + 1 :]):
        rows = rows[:-1]
    comment = next((c for line in lines for c in COMMENTS if line.lstrip().startswith(c)), "")
    return lines, rows, replace(form, comment=comment)


def _first_block(lines: list[str]) -> list[str]:
    """Lines before a header that comes again below its numbers."""
    places: dict[str, int] = {}
    for k, line in enumerate(lines):
        text = line.strip()
        if not text[:1].isalpha():
            continue
        if sum(map(_begins_a_row, lines[places.get(text, k) : k])) >= MIN_ROWS:
            return lines[:k]
        places.setdefault(text, k)
    return lines


def _without_footer(lines: list[str]) -> list[str]:
    """Lines down to the last that begins with a number, where some above it do so as well."""
    last = max((k for k, line in enumerate(lines) if _begins_a_row(line)), default=0)
    above = lines[max(last + 1 - MIN_ROWS, 0) : last + 1]
    return lines[: last + 1] if len(above) == MIN_ROWS and all(map(_begins_a_row, above)) else lines


def _begins_a_row(line: str) -> bool:
    return line.lstrip(' \t"')[:1] in tuple("+-.0123456789")


def _counts(cells: Sequence[str], below: Sequence[str]) -> bool:
    """Return whether a first row says how many samples each channel has: whole numbers, the lines below at most."""
    found = [cell for cell in cells if cell]
    if not all(cell.isdecimal() for cell in found):
        return False
    count = sum(1 for line in below if line.strip())
    most = max(map(int, found), default=0)
    return most == count and min(map(int, found)) > 0.5 * most


def _first_of(lines: list[str], rows: Rows, form: TextForm) -> int:
    """Place of the first row of numbers: `Interval,0.5` is none above rows that are all numbers.

    What is no number below a row of names is a sample that is wrong.
    """
    usual = [2 * sum(kinds[k] for _, kinds in rows) > len(rows) for k in range(len(rows[0][1]))]
    like = [place for place, kinds in rows if all(map(operator.ge, kinds, usual))]
    top, first = rows[-1][0], min(like, default=rows[-1][0])
    odd = [cells_of(line, form) for line in lines[top:first] if line.strip()]
    above = header_of(lines[:top], form, [[""] * len(usual)]) if odd and not any(map(is_keyed, odd)) else Header()
    return top if above.row else first


def _transposed(above: Sequence[str], rows: Rows, form: TextForm) -> Header | None:
    """The header of a table whose quantities stand in lines: as many names as lines, or a name before each line."""
    count, columns = len(rows), len(rows[0][1])
    if not 2 <= count < columns:
        return None
    if all(not kinds[0] and all(kinds[1:]) for _, kinds in rows):
        words = f"{count} names before as many rows of {columns - 1} numbers: the table is taken as transposed"
        return Header(said=(words,))
    place = max((k for k, line in enumerate(above) if line.strip()), default=None)
    if place is None or not all(all(kinds) for _, kinds in rows):
        return None
    names = next((n for n in ways(above[place], form, True) if len(n) == count and all(map(_is_word, n))), None)
    if names is None:
        return None
    words = f"{count} names, {columns} columns, {count} rows: the table is taken as transposed"
    return Header(place + 1, () if tuple(names) == cells_in(above[place], form) else tuple(names), said=(words,))


def _is_word(cell: str) -> bool:
    return re.match(r"[^\W\d_]", cell) is not None


def _encoding(path: Path) -> str:
    content = read_bytes(path)
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    if b"\0" in content[:4096]:
        raise InputError("expected a text file, found a binary one", file=path)
    try:
        content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def _rows(lines: list[str], form: TextForm) -> Rows:
    """The rows at the end of the lines that are numbers read this way, last first; of each cell whether it is one.

    A delimiter at the end of a line ends its last cell, or begins one that is empty: as other lines have it.
    """
    number = _NUMBER[form.decimal]
    rows: Rows = []
    widths: set[int] = set()  # of lines that end in a cell
    for place in range(len(lines) - 1, -1, -1):
        line = lines[place]
        if not line.strip() or line.lstrip().startswith(COMMENTS):
            continue
        cells = cells_of(line, form)
        is_open = form.delimiter != " " and line.rstrip(" \r").endswith(form.delimiter)
        width = next(iter(widths), len(rows[0][1]) if rows else len(cells))
        fits = not rows or len(cells) in _widths_like(width, is_open, bool(widths))
        if fits and any(_is_number(cell, number) for cell in cells):
            widths |= set() if is_open else {len(cells)}
            rows.append((place, [_is_number(cell, number) or cell.lower() in MISSING for cell in cells]))
        elif not rows or len(cells) == width or is_keyed(cells) or not _goes_on(lines[:place], form, width):
            break  # else a remark, or a row that lost a cell, which is no header
    width = max((len(kinds) for _, kinds in rows), default=0)
    return [(place, kinds + [True] * (width - len(kinds))) for place, kinds in rows]


def _widths_like(width: int, is_open: bool, is_known: bool) -> set[int]:
    """How many cells a row may have; `is_open`: a delimiter ends it; `is_known`: a row without one has this width."""
    if is_open:
        return {width, width - 1}
    return {width} if is_known else {width, width + 1}


def _goes_on(above: Sequence[str], form: TextForm, width: int) -> bool:
    """Return whether the nearest lines above one of another kind are rows of numbers, as wide as those below it."""
    number = _NUMBER[form.decimal]
    filled = [line for line in above if line.strip()][-2 * MIN_ROWS :]
    nearest = [cells_of(line, form) for line in filled if _begins_a_row(line)][-MIN_ROWS:]
    numbers = [sum(_is_number(cell, number) for cell in cells) for cells in nearest]
    fit = [width - 1 <= len(cells) <= width and 2 * n >= width for cells, n in zip(nearest, numbers, strict=True)]
    return len(fit) == MIN_ROWS and all(fit)


def _likely(rows: Rows, form: TextForm) -> tuple[float, bool, int, bool]:
    """What the likeliest way to read the lines has most of: numbers among its cells first."""
    cells = [kind for _, kinds in rows for kind in kinds]
    share = sum(cells) / max(len(cells), 1)
    return round(share, 3), len(rows) > 1, len(cells) // max(len(rows), 1), form.decimal == "."


def _is_number(cell: str, number: re.Pattern[str]) -> bool:
    return number.match(cell) is not None or clock_seconds(cell) is not None


def read_csv_or_hint(path: str | Path) -> Table:
    """As `read_csv`; where that fails and the file seems to be written otherwise, the error says how.

    Raises
    ------
    InputError
        As `read_csv`.
    """
    path = as_path(path)
    check_suffix(path)
    if not is_text(path) or is_spreadsheet(path):
        raise InputError(f"expected CSV, found {path.suffix}; {NEW_STUDY}", file=path)
    try:
        return read_text_recording(path, TextForm(strict=True))
    except InputError as error:
        hint = _hint(path)
        if not hint:
            raise
        message = f"{error.message}; {hint}"
        raise InputError(message, file=error.file, row=error.row, column=error.column) from None


def _hint(path: Path) -> str:
    try:
        form, _ = sniffed(path)
    except InputError:
        return ""
    words = form.in_words()
    return f"it seems to have {words}: {NEW_STUDY}" if words else ""
