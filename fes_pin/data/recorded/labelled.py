"""Lines of a serial port in which a number stands behind its name: `1200,angle: 1.36 deg,torque:0.2`, or one a line."""

import re
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from fes_pin.data.errors import listed
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
    between = _between(text)
    found = [_cell(cell) for cell in text.rstrip(between or None).split(between)] if between else _apart(text)
    cells = [cell for cell in found if cell]
    if len(cells) < len(found) or not any(name for name, *_ in cells):
        return None
    names, numbers, units = zip(*cells, strict=True)
    return Labelled(between or ";", names, numbers, units)


def _between(text: str) -> str:
    """The sign between the cells of a line; "" of blanks, and of a single cell, `angle: 1,36`."""
    one = _cell(text)
    return "" if one and one[0] else next((sign for sign in _BETWEEN if sign in text), "")


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

    A record is a line, or several whose names come again in one order. The last one may be cut off.
    """
    found = [parts_of(line) for line in lines]
    records = _records(found)
    count = len(records[0]) if records else 0
    last = {*[k for k, line in enumerate(lines) if _has_digit(line)][-(MIN_ROWS + 1) * count :]}
    whole = [_columns([p for k in record if (p := found[k])]) for record in records if last.issuperset(record)]
    return whole[0] if len(whole) >= MIN_ROWS and len({*whole}) == 1 else ()


def _has_digit(line: str) -> bool:
    return re.search(r"\d", line) is not None


def _columns(record: Sequence[Labelled]) -> tuple[str, ...]:
    """Names of the columns of a record, with their units."""
    pairs = (pair for line in record for pair in zip(line.names, line.units, strict=True))
    return tuple(f"{name} [{unit}]" if unit else name for name, unit in pairs)


def why_no_names(lines: Sequence[str]) -> str:
    """Why lines that name their numbers are not read, and what to do; "" of other lines, and of those that are."""
    filled = [line for line in lines if line.strip()]
    names = [", ".join(filter(None, p.names)) for line in filled if (p := parts_of(line))]
    is_all = all(map(parts_of, [line for line in filled if _has_digit(line)][-MIN_ROWS:]))
    if not is_all or len(names) < MIN_ROWS * max(len({*names}), 1) or names_before_numbers(lines):
        return ""
    known = listed([*dict.fromkeys(names)])
    return (
        f"numbers stand behind names that come again in no order, {known}: write the lines of each record in one order"
    )


def _records(found: Sequence[Labelled | None]) -> list[list[int]]:
    """Places of the lines of each record: their names come in one order; what is between them has no names.

    A record begins as the first one in the file does, or after an empty line or another without names.
    """
    count = Counter(p.names for p in found if p)
    most = max(count.values(), default=0)
    order = [names for names, times in count.items() if 2 * times > most]
    after = Counter(p.names for before, p in pairwise(found) if p and before is None and p.names in order)
    names, times = next(iter(after.most_common(1)), ((), 0))
    if 2 * times > most:
        order = [*order[order.index(names) :], *order[: order.index(names)]]
    records, record = list[list[int]](), list[int]()
    for place, p in enumerate(found):
        if p is None:
            continue
        is_next = p.names == order[len(record)]
        record = [*record, place] if is_next else [place] * (p.names == order[0])
        if len(record) == len(order):
            records.append(record)
            record = []
    return records


def without_names(lines: Sequence[str]) -> list[str]:
    """Lines with their numbers alone, where they have the names that most have before them; others as they are.

    A record of several lines stands in the last of them. A last line that has those names no more was cut off, and is
    called so: it is none of numbers.
    """
    found = [parts_of(line) for line in lines]
    records = _records(found)
    out = [line if re.search(r"\w", line) or not records else "" for line in lines]  # `-----` between records
    for record in records:
        parts = [p for k in record if (p := found[k])]
        between = parts[0].between if len(parts) == 1 else ";"
        out[record[0] : record[-1] + 1] = [""] * (record[-1] - record[0] + 1)
        out[record[-1]] = between.join(number for p in parts for number in p.numbers)
    last = max((k for k, line in enumerate(out) if line.strip()), default=0)
    if records and last != records[-1][-1]:
        out[last] = f"cut off: {lines[last]}"
    return out
