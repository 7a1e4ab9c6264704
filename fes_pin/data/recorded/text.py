"""Text files of numbers in whatever form an instrument writes them: delimiter, decimal comma, units rows, comments.

They are read fast where they are clean, and cell by cell to say where they are not.
"""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.files import as_path
from fes_pin.data.recorded.clock import clock_seconds, from_first
from fes_pin.data.recorded.form import AFTER_COMMENTS, MISSING, NUMERIC, TextForm, cells_of
from fes_pin.data.recorded.passed_over import begins_with_sample, lines_between, passed_over
from fes_pin.data.table import MIN_ROWS, Table
from fes_pin.data.units import are_units, bare_unit


def without_twins(names: list[str]) -> tuple[str, ...]:
    """Names of which no two are the same: the second `Value` is `Value#2`; what has none is called by its place."""
    out: list[str] = []
    for place, name in enumerate(names, 1):
        base = name or f"column{place}"
        count = sum(1 for other in names[: place - 1] if other == name) + 1 if name else 1
        out.append(base if count == 1 else f"{base}#{count}")
    return tuple(out)


def read_csv(path: str | Path, wanted: Sequence[str] | None = None) -> Table:
    """Read comma-separated numbers under one header row.

    Parameters
    ----------
    wanted
        Names of the columns whose cells must be numbers; None for all.

    Raises
    ------
    InputError
        No header, a duplicated or nameless column, fewer than 3 rows, a ragged row, text or nothing where a number
        belongs, a number that is not finite: with its row and column.
    """
    return read_text_recording(as_path(path), TextForm(strict=True), wanted)


def read_text_recording(path: Path, form: TextForm, wanted: Sequence[str] | None = None) -> Table:
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
    lines = form.lines(path)
    if form.header_row == AFTER_COMMENTS:
        row = row_after_comments(lines, form)
        form = replace(form, header_row=row, first_row=row + 1)
    if form.transposed:
        return _transposed(path, lines, form, wanted)
    return table_of_lines(path, lines, names_of(path, lines, form), form, wanted)


def after_comments(path: Path, form: TextForm | None) -> TextForm | None:
    """The form of a file whose names follow its comments, however many lines these are; another as it is."""
    if form is None or not form.comment or form.first_row != form.header_row + 1:
        return form
    lines = form.lines(path)
    is_next = form.header_row == row_after_comments(lines, form)
    return replace(form, header_row=AFTER_COMMENTS, first_row=AFTER_COMMENTS + 1) if is_next else form


def row_after_comments(lines: Sequence[str], form: TextForm) -> int:
    """The first line, from 1, that is neither a comment nor empty; 1 where there is none."""
    kept = (k for k, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith(form.comment))
    return next(kept, 1)


def _transposed(path: Path, lines: list[str], form: TextForm, wanted: Sequence[str] | None) -> Table:
    """The table whose quantities stand in lines; a sample's row is its place in them."""
    cells = _equal_lines(path, lines, form)
    if form.names or form.header_row:
        names = names_of(path, lines, form)
    elif all(NUMERIC.match(row[0]) for row in cells):
        names = without_twins([""] * len(cells))
    else:
        names, cells = without_twins([row[0] for row in cells]), [row[1:] for row in cells]
    if len(names) != len(cells):
        raise InputError(f"expected {len(cells)} names of as many lines, found {len(names)}", file=path)
    between = ";" if form.decimal == "," else ","
    turned = [between.join(row) for row in zip(*cells, strict=True)]
    table = table_of_lines(path, turned, names, TextForm(between, form.decimal, 0, 1), wanted)
    return replace(table, header_row=form.header_row)


def _equal_lines(path: Path, lines: list[str], form: TextForm) -> list[list[str]]:
    """Cells of the lines of numbers, as many in each."""
    body, rows = _body(lines, form)
    cells = [cells_of(line, form) for line in body]
    if not cells:
        raise InputError("expected numbers", file=path, row=form.first_row)
    for row, found in zip(rows.tolist(), cells, strict=True):
        if len(found) != len(cells[0]):
            raise InputError(f"expected lines of {len(cells[0])} values, found {len(found)}", file=path, row=row)
    return cells


def table_of_lines(
    path: Path, lines: list[str], names: tuple[str, ...], form: TextForm, wanted: Sequence[str] | None = None
) -> Table:
    """The table of a text file's lines, as `read_text_recording`; its columns have these names."""
    chosen = [n for n in names if wanted is None or n in wanted]
    body, rows = _body(lines, form)
    if len(body) < MIN_ROWS:
        row = int(rows[-1]) if len(rows) else form.first_row - 1
        message = f"expected at least {MIN_ROWS} rows of numbers, found {len(body)}"
        raise InputError(message, file=path, row=row, column=names[0] if names else None)
    if form.names:
        _check_count(path, body, rows, form)
    places = [names.index(n) for n in chosen]
    clocks: dict[str, str] = {}
    values = _fast(body, form, places, len(names))
    if values is None:
        values, clocks = _slowly(path, body, rows, form, (names, places))

    def half_digit(name: str) -> float:
        place = names.index(name)
        texts = (cells_of(line, form) for line in body)
        return 0.5 * 10.0 ** -max(_decimals(cells[place], form.decimal) for cells in texts if place < len(cells))

    columns = dict(zip(chosen, values.T.copy(), strict=True))
    units = {**units_between(lines, names, form), **dict.fromkeys(clocks, "s")}
    sentences = (
        *(f"{name} holds {what}: it is read as seconds from its first row" for name, what in clocks.items()),
        *(() if form.strict or form.transposed else passed_over(lines, body, rows, form)),
    )
    return Table(path, names, columns, rows, form.header_row, units, half_digit_of=half_digit, said=sentences)


def units_between(lines: list[str], names: tuple[str, ...], form: TextForm) -> dict[str, str]:
    """By name the units that the first line between the header and the numbers states; none of a line of other cells.

    A unit that is not known is kept as the file has it.
    """
    between = lines[form.header_row : form.first_row - 1] if form.header_row else []
    for line in between:
        cells = cells_of(line.lstrip().removeprefix(form.comment or "\0"), form)
        cells += [""] * (len(cells) == len(names) - 1)  # a last one that is empty, as of a unit of words
        if len(cells) == len(names) and are_units(cells):
            return {name: unit for name, cell in zip(names, cells, strict=True) if (unit := bare_unit(cell))}
    return {}


def _check_count(path: Path, body: list[str], rows: np.ndarray, form: TextForm) -> None:
    """Require as many names that are stated as the first row has cells; one more where a delimiter ends it."""
    cells, ends = len(cells_of(body[0], form)), body[0].rstrip(" \r").endswith(form.delimiter)
    if len(form.names) not in (cells, cells + ends):
        message = f"expected names of {cells} columns, found {len(form.names)}"
        raise InputError(message, file=path, row=int(rows[0]))


def names_of(path: Path, lines: list[str], form: TextForm) -> tuple[str, ...]:
    """Names of the columns of a text file's lines, as its form says.

    Raises
    ------
    InputError
        No header where the form has one; where it is strict also a column without a name, or two of one name.
    """
    if form.names:
        return without_twins(list(form.names))
    if not form.header_row:
        below = (line for line in lines[form.first_row - 1 :] if line.strip())
        first = next(below, "")
        if first.rstrip(" \r").endswith(form.delimiter):  # its last cell may be empty, or the delimiter ends it
            first = next((line for line in below if not line.rstrip(" \r").endswith(form.delimiter)), first)
        return without_twins([""] * len(cells_of(first, form)))
    line = lines[form.header_row - 1] if form.header_row <= len(lines) else ""
    names = cells_of(line.removeprefix(form.comment), form)
    if not names or not line.strip():
        raise InputError("expected a header row of column names, found nothing", file=path, row=form.header_row)
    if not form.strict:
        return without_twins(names)
    names = [name.strip('"') for name in names]
    for index, name in enumerate(names):
        if not name:
            raise InputError("expected a column name", file=path, row=form.header_row, column=f"#{index + 1}")
        if name in names[:index]:
            raise InputError("this column is there twice", file=path, row=form.header_row, column=name)
    return tuple(names)


def _body(lines: list[str], form: TextForm) -> tuple[list[str], np.ndarray]:
    """The lines of numbers, and where each stands; where the form is strict also blank ones before the last."""
    found = list(enumerate(lines[form.first_row - 1 :], form.first_row))
    while found and not found[-1][1].strip():
        found.pop()
    if not form.strict:
        found = _without_lines_between(found, lines[: form.first_row - 1], form)
    if form.comment:
        found = [(row, line) for row, line in found if not line.lstrip().startswith(form.comment)]
    if not form.strict and found and begins_with_sample(found[0][1], form):
        while not begins_with_sample(found[-1][1], form):  # a summary, `End of data`
            found.pop()
    return [line for _, line in found], np.array([row for row, _ in found], dtype=int)


def _without_lines_between(found: list[tuple[int, str]], above: list[str], form: TextForm) -> list[tuple[int, str]]:
    """Numbered lines without blank ones, and without those between the rows that are no row."""
    found = [(row, line) for row, line in found if line.strip()]
    between = set(lines_between([line for _, line in found], above, form))
    return [(row, line) for row, line in found if line not in between] if between else found


def _fast(body: list[str], form: TextForm, places: list[int], count: int) -> np.ndarray | None:
    """All numbers at once; None where something in the file must be looked at cell by cell."""
    is_whole = form.strict and len(places) == count  # then NumPy refuses what is odd itself
    if not is_whole and not _is_regular(body, form, count):
        return None
    lines = [line.replace(",", ".") for line in body] if form.decimal == "," else body
    delimiter, chosen = None if form.delimiter == " " else form.delimiter, None if is_whole else places
    try:
        values = np.loadtxt(lines, dtype=float, delimiter=delimiter, comments=None, ndmin=2, usecols=chosen)
    except ValueError:
        return None
    there = np.isfinite(values) if form.strict else ~np.isinf(values)
    return values if values.shape == (len(body), len(places)) and there.all() else None


def _is_regular(body: list[str], form: TextForm, count: int) -> bool:
    """True of lines of as many cells as there are names, without quotes or points that part thousands."""
    odd = '".' if form.decimal == "," else '"'
    delimiter = None if form.delimiter == " " else form.delimiter
    cells = {len(line.split(delimiter)) for line in body}
    most = count if form.strict or delimiter is None else count + 1  # a delimiter at the end begins no cell
    if most > count and cells == {most} and not all(line.rstrip(" \r").endswith(form.delimiter) for line in body):
        return False
    return len(cells) == 1 and cells <= {count, most} and not any(sign in line for line in body for sign in odd)


def _slowly(
    path: Path, body: list[str], rows: np.ndarray, form: TextForm, which: tuple[tuple[str, ...], list[int]]
) -> tuple[np.ndarray, dict[str, str]]:
    """All numbers, cell by cell, and by name what columns hold that are times of a clock, in words."""
    names, places = which
    clocks: dict[str, str] = {}
    values = np.empty((len(body), len(places)))
    for index, (line, row) in enumerate(zip(body, rows.tolist(), strict=True)):
        error = partial(InputError, file=path, row=row)
        cells = _whole(line, names, form, error)
        for k, place in enumerate(places):
            values[index, k], clock = _reading(cells[place], form, partial(error, column=names[place]))
            if clock:
                clocks[names[place]] = clock
    for k, place in enumerate(places):
        if what := clocks.get(names[place]):
            values[:, k] = from_first(values[:, k], of_day=what != "dates")
    return values, clocks


def _whole(line: str, names: tuple[str, ...], form: TextForm, error: Callable[..., InputError]) -> list[str]:
    """A cell of a line for each name; "" for those that are missing at its end, where the form is not strict."""
    cells, count = cells_of(line, form), len(names)
    if not line.strip():
        raise error("expected numbers, found an empty row", column=names[0])
    if len(cells) > count or (form.strict and len(cells) < count):
        message = f"expected {count} values as in the header, found {len(cells)}"
        raise error(message, column=names[min(len(cells), count - 1)])
    return cells + [""] * (count - len(cells))


def _reading(cell: str, form: TextForm, error: Callable[[str], InputError]) -> tuple[float, str]:
    """The number that a cell says, NaN of a sample that is missing; of a clock s, and what kind it is in words."""
    if form.strict and not cell:
        raise error("expected a number, found nothing")
    if not form.strict and cell.lower() in MISSING:
        return math.nan, ""
    clock = None if form.strict else clock_seconds(cell)
    return clock or (_number(cell, form.decimal, error), "")


def _number(cell: str, decimal: str, error: Callable[[str], InputError]) -> float:
    """The finite number that a cell says with this decimal sign."""
    try:
        if "_" in cell or (decimal == "," and "." in cell):
            raise ValueError
        value = float(cell.replace(decimal, "."))
    except ValueError:
        what = "a number with a decimal comma" if decimal == "," else "a number"
        raise error(f"expected {what}, found {cell[:40]!r}") from None
    if not math.isfinite(value):
        raise error(f"expected a finite number, found {cell[:40]!r}")
    return value


def _decimals(cell: str, decimal: str) -> int:
    """How many digits stand after the decimal sign, an exponent counted in."""
    mantissa, _, exponent = cell.lower().partition("e")
    digits = len(re.split(r"[^\d]", mantissa.rpartition(":")[2].partition(decimal)[2].strip(), maxsplit=1)[0])
    return digits - (int(exponent) if exponent.lstrip("+-").isdigit() else 0)
