"""Lines of a serial port in which a number stands behind its name: `1200,angle: 1.36 deg,torque:0.2`."""

import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from fes_pin.data.recorded.clock import clock_seconds
from fes_pin.data.table import MIN_ROWS

_NUMBER = r"[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?"
_UNIT = r"[^\W\d][^\s\d:=]*|°\S*|%"
_CELL = re.compile(rf"\s*(?:([^\W\d][^:=]*?)\s*[:=]\s*)?({_NUMBER}|nan)\s*({_UNIT})?\s*", re.IGNORECASE)
_WORDS = re.compile(rf"\s*([^\W\d][^\s:=]*)\s*[:=]\s*({_NUMBER}|nan)(?:\s*({_UNIT})(?=\s|$)(?!\s*[:=]))?(?=\s|$)", re.I)
_BETWEEN = (";", "\t", ",")


class Labelled(NamedTuple):
    """One line: the sign between its cells, and of each cell its name, "" of one without, its number and its unit."""

    between: str
    names: tuple[str, ...]
    numbers: tuple[str, ...]
    units: tuple[str, ...]


def parts_of(line: str) -> Labelled | None:
    """The names, numbers and units of a line; None of one that has no names before its numbers, or other words."""
    text = line.strip()
    if "=" not in text and ":" not in text:
        return None
    between = next((sign for sign in _BETWEEN if sign in text), "")
    cells = [_cell(cell) for cell in text.rstrip(between or None).split(between)] if between else _apart(text)
    if not cells or None in cells or not any(cell and cell[0] for cell in cells):
        return None
    names, numbers, units = zip(*(cell for cell in cells if cell), strict=True)
    return Labelled(between or ";", names, numbers, units)


def _cell(text: str) -> tuple[str, str, str] | None:
    """Name, number and unit of a cell; a time of a clock is a number."""
    if clock_seconds(text.strip()) is not None:
        return "", text.strip(), ""
    found = _CELL.fullmatch(text)
    return (found[1] or "", found[2], found[3] or "") if found else None


def _apart(text: str) -> list[tuple[str, str, str] | None]:
    """Cells of a line with nothing but blanks between them."""
    out, place = list[tuple[str, str, str] | None](), 0
    while place < len(text):
        found = _WORDS.match(text, place)
        if not found:
            return [None]
        out.append((found[1], found[2], found[3] or ""))
        place = found.end()
    return out


def names_before_numbers(lines: Sequence[str]) -> tuple[str, ...]:
    """Names of the columns of lines that have them before their numbers, with their units; () of others.

    The last lines but one, which may be cut off, have the same names.
    """
    last = [line for line in lines if line.strip()][-MIN_ROWS - 1 : -1]
    found = {(p.names, p.units) if (p := parts_of(line)) else None for line in last}
    one = next(iter(found), None)
    if len(last) < MIN_ROWS or len(found) > 1 or one is None:
        return ()
    return tuple(f"{name} [{unit}]" if unit else name for name, unit in zip(*one, strict=True))


def without_names(lines: Sequence[str]) -> list[str]:
    """Lines with their numbers alone, where they have the names that most have before them; others as they are.

    A last line that has them no more was cut off, and is called so: it is none of numbers.
    """
    found = [parts_of(line) for line in lines]
    usual = Counter(p.names for p in found if p).most_common(1)
    found = [p if p and p.names == usual[0][0] else None for p in found]
    out = [p.between.join(p.numbers) if p else line for line, p in zip(lines, found, strict=True)]
    last = max((k for k, line in enumerate(lines) if line.strip()), default=0)
    if any(found) and not found[last]:
        out[last] = f"cut off: {lines[last]}"
    return out
