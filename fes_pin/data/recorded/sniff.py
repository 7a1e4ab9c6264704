"""What form a text file seems to have, and which column of a recording is probably which of the rig's, in which unit.

The form is proposed to a person, or named by an error, and never used unseen. Columns are known from names, never from
numbers.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fes_pin.data.errors import InputError
from fes_pin.data.files import as_path, read_bytes, read_text
from fes_pin.data.recorded.formats import check_suffix, is_text, read_recording
from fes_pin.data.recorded.text import DECIMALS, DELIMITERS, MISSING, TextForm, cells_of, read_text_recording
from fes_pin.data.schema import MEANT, RigSchema, without_unit
from fes_pin.data.table import Table
from fes_pin.data.units import UNITS, is_another, known_unit, quantities_of, split_header

LOOKED_AT = 400
"""Lines that are looked at; no preamble of an instrument is nearly as long."""
NEW_STUDY = "`fes-pin new-study` writes a [columns] table that reads it as it is"
COMMENTS = ("#", "%", "//")
_NUMBER = {
    ".": re.compile(r"^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$"),
    ",": re.compile(r"^[+-]?\d+(,\d+)?([eE][+-]?\d+)?$"),
}


def sniff(path: Path) -> tuple[TextForm, dict[int, str]]:
    """The form that a text file seems to have, and the units that a row of it names, by place of the column.

    Raises
    ------
    InputError
        Not a text file, or no rows of numbers in it.
    """
    encoding = _encoding(path)
    lines = read_text(path, encoding).split("\n")[:LOOKED_AT]
    forms = [TextForm(delimiter, decimal, encoding=encoding) for delimiter in DELIMITERS for decimal in DECIMALS]
    rows, form = max(((_rows(lines, form), form) for form in forms), key=lambda pair: _likely(*pair))
    if not rows:
        raise InputError("expected rows of numbers, found none", file=path)
    first, kinds = rows[-1]
    comment = next((c for line in lines for c in COMMENTS if line.lstrip().startswith(c)), "")
    header, units = _header(lines[:first], replace(form, comment=comment), len(kinds))
    return replace(form, header_row=header, first_row=first + 1, comment=comment), units


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


def _rows(lines: list[str], form: TextForm) -> list[tuple[int, list[bool]]]:
    """The rows at the end of the lines that are numbers read this way, last first; of each cell whether it is one."""
    number = _NUMBER[form.decimal]
    rows: list[tuple[int, list[bool]]] = []
    for place in range(len(lines) - 1, -1, -1):
        line = lines[place]
        if not line.strip() or line.lstrip().startswith(COMMENTS):
            continue
        cells = cells_of(line, form)
        kinds = [bool(number.match(cell)) or cell.lower() in MISSING for cell in cells]
        if (rows and len(kinds) != len(rows[0][1])) or not any(map(number.match, cells)):
            break
        rows.append((place, kinds))
    return rows


def _likely(rows: list[tuple[int, list[bool]]], form: TextForm) -> tuple[float, bool, int, bool]:
    """What the likeliest way to read the lines has most of: numbers among its cells first."""
    cells = [kind for _, kinds in rows for kind in kinds]
    share = sum(cells) / max(len(cells), 1)
    return round(share, 3), len(rows) > 1, len(cells) // max(len(rows), 1), form.decimal == "."


def _header(lines: list[str], form: TextForm, columns: int) -> tuple[int, dict[int, str]]:
    """Row of the names in the lines above the numbers, 0 if there is none; and the units of a row between, by place."""
    units: dict[int, str] = {}
    nearest = 0
    for place in range(len(lines) - 1, -1, -1):
        line = lines[place].lstrip()
        cells = cells_of(line.removeprefix(form.comment), form)
        cells += [""] * (len(cells) == columns - 1)  # a last one that is empty, as of a unit of words
        if not line or len(cells) != columns or not any(re.search(r"[^\W\d_]", c) for c in cells):
            continue
        if not units and place and _are_units(cells):
            units, nearest = {k: cell.strip("[](){} ") for k, cell in enumerate(cells)}, place + 1
            continue
        return place + 1, units
    return nearest, {}  # a row like one of units, with no names above it, holds the names


def _are_units(cells: list[str]) -> bool:
    bare = [cell.strip("[](){} ") for cell in cells]
    stated = [cell for cell in bare if cell not in ("", "-", "1")]
    bracketed = all(cell[:1] in "[({" for cell in cells if cell)
    return bool(stated) and (bracketed or all(known_unit(cell, tuple(UNITS)) for cell in stated))


def read_csv_or_hint(path: str | Path) -> Table:
    """As `read_csv`; where that fails and the file seems to be written otherwise, the error says how.

    Raises
    ------
    InputError
        As `read_csv`.
    """
    path = as_path(path)
    check_suffix(path)
    if not is_text(path):
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
        form, _ = sniff(path)
    except InputError:
        return ""
    words = form.in_words()
    return f"it seems to have {words}: {NEW_STUDY}" if words else ""


@dataclass(frozen=True)
class Proposal:
    """What a file seems to hold.

    Parameters
    ----------
    recording
        The file with all of its columns that are numbers.
    form
        Of a text file; None of another.
    candidates
        Names of columns that could be each of the rig's.
    units
        Unit of each of the file's columns as its name or the file itself states it; "" where neither does.
    """

    recording: Table
    form: TextForm | None
    candidates: Mapping[str, tuple[str, ...]]
    units: Mapping[str, str]


def propose(path: Path, schema: RigSchema, revolute: bool | None) -> Proposal:
    """What a file seems to hold for a rig.

    Raises
    ------
    InputError
        The file cannot be read, or holds no numbers.
    """
    form, stated = sniff(path) if is_text(path) else (None, {})
    if form is None:
        recording = read_recording(path)
        units = dict(recording.units)
    else:
        recording = _numbers(path, form)
        units = {name: stated[k] for k, name in enumerate(recording.names) if stated.get(k)}
    for name in recording.columns:
        units.setdefault(name, split_header(name)[1])
    named = {c: tuple(_candidates(c, recording.columns, units, revolute)) for c in schema.columns}
    named = _without_doubles(named)
    candidates = {c: found or _by_unit(c, named, units, revolute) for c, found in named.items()}
    return Proposal(recording, form, _without_doubles(candidates), units)


def _numbers(path: Path, form: TextForm) -> Table:
    """A text file's columns of numbers; columns of words or of dates are among its names only."""
    names = read_text_recording(path, form, ()).names
    while True:
        try:
            return read_text_recording(path, form, names)
        except InputError as error:
            if error.column not in names:
                raise
            names = tuple(n for n in names if n != error.column)


def _candidates(
    column: str, names: Sequence[str] | Mapping[str, object], units: Mapping[str, str], revolute: bool | None
) -> Iterator[str]:
    for name in names:
        bare, _ = split_header(name)
        unit = units.get(name, "")
        if is_another(unit, column, revolute):
            continue
        words = _words(bare)
        if name == column or without_unit(column) == "_".join(words) or words & MEANT.get(column, frozenset()):
            yield name


def _by_unit(
    column: str, named: Mapping[str, tuple[str, ...]], units: Mapping[str, str], revolute: bool | None
) -> tuple[str, ...]:
    """Columns that no word of theirs gives away and whose unit is one of this quantity: `Kniewinkel [deg]`."""
    taken = {name for names in named.values() for name in names}
    quantities = quantities_of(column, revolute)
    return tuple(n for n, unit in units.items() if unit and n not in taken and known_unit(unit, quantities))


def _words(name: str) -> frozenset[str]:
    """Lower-case words of a name: `Motor Torque`, `motorTorque`, `knee.angle`."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return frozenset(w for w in re.split(r"[^a-z0-9]+", apart.lower()) if w)


def _without_doubles(candidates: Mapping[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
    """A name that is the only candidate of one column is none of another's."""
    out = dict(candidates)
    for _ in out:
        sole = {names[0]: c for c, names in out.items() if len(names) == 1}
        out = {c: tuple(n for n in names if sole.get(n, c) == c) for c, names in out.items()}
    return out
