"""What stands above the numbers of a text file: names, units and the sample rate, in the ways that instruments have."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from fes_pin.data.recorded.exports import channels_of
from fes_pin.data.recorded.form import TextForm, cells_of
from fes_pin.data.units import UNITS, are_units, bare_unit, is_unit_of, known_unit, split_header

NUMBER = re.compile(r"^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$")
_SAMPLING = r"(?:(?:data|sampl\w*|acquisition|analog|scan|frame|camera|recording)\s+)"
_KEYS = {
    "names": re.compile(r"^(channel|signal)s?\s*(name|title|label)?s?$"),
    "units": re.compile(r"^(channel\s+)?units?\s?(names?)?$"),
    "interval": re.compile(rf"^({_SAMPLING}?(time\s+)?interval|{_SAMPLING}(time|period|step)|dt|delta t)$"),
    "rate": re.compile(rf"^({_SAMPLING}?(rate|frequency)|fs)$"),
}
"""What a line before the numbers says, by its first cell; a rate of pulses or of a heart is none of samples."""


@dataclass(frozen=True)
class Header:
    """What stands above the numbers.

    Parameters
    ----------
    row
        Line of the names, from 1; 0 if there is none.
    names
        Of the columns where the line, read as cells, does not have them so.
    units
        By place of the column, where the file states them, without brackets.
    rate_hz
        Of the samples, where the file states it.
    said
        What is odd about it, and how the names were found, a sentence each.
    """

    row: int = 0
    names: tuple[str, ...] = ()
    units: Mapping[int, str] = field(default_factory=dict)
    rate_hz: float | None = None
    said: tuple[str, ...] = ()


def header_of(lines: Sequence[str], form: TextForm, numbers: Sequence[Sequence[str]]) -> Header:
    """What the lines above the numbers say of their columns.

    Parameters
    ----------
    numbers
        Cells of the first two rows of numbers.
    """
    columns = len(numbers[0])
    if (known := channels_of(lines, form, columns)) is not None:
        return Header(known.row, known.names, known.units, known.rate_hz)
    keyed = _keyed(lines, form, columns)
    rate = next((rate for _, kind, cells in keyed if (rate := _rate(kind, cells)) is not None), None)
    of_rates = {row for row, kind, cells in keyed if _rate(kind, cells) is not None}
    found = _from_keys(keyed, numbers, rate) or _from_rows(lines, form, columns, of_rates)
    names = found.names or (cells_in(lines[found.row - 1], form) if found.row else ())
    rate = rate or _rate_of_frames(lines, form, names)
    return Header(found.row, found.names, found.units, rate, found.said)


def _from_rows(lines: Sequence[str], form: TextForm, columns: int, keyed: set[int]) -> Header:
    """Names in the nearest line that has as many cells, with the units of a line below or above it."""
    rows = _wordy(lines, form, columns, keyed)
    if not rows:
        return Header(said=_too_few(lines, form, columns, keyed))
    place, names, units = (*rows[0], {}) if len(rows) == 1 else _of_two(*rows)
    plain = cells_in(lines[place], form)
    plain = (*plain, *[""] * (len(names) - len(plain)))
    return Header(place + 1, () if plain == tuple(names) else tuple(names), units)


def _wordy(lines: Sequence[str], form: TextForm, columns: int, keyed: set[int]) -> list[tuple[int, list[str]]]:
    """Places and cells of the nearest line of words with a cell for each column, and of one that stands next above."""
    rows: list[tuple[int, list[str]]] = []
    filled = [place for place, line in enumerate(lines) if line.strip()]
    for place in reversed(filled):
        cells = [] if place in keyed else _names_in(lines[place], form, columns, is_nearest=place == filled[-1])
        if any(re.search(r"[^\W\d_]", cell) for cell in cells):
            rows.append((place, cells))
        elif rows:
            break  # of what stands above a line of another kind nothing belongs to these columns
    return rows[:2]


def _of_two(nearest: tuple[int, list[str]], higher: tuple[int, list[str]]) -> tuple[int, list[str], dict[int, str]]:
    """Of two lines the place of the one that has the names; these; and by place of the column what units they state."""
    for (place, names), (_, units) in ((higher, nearest), (nearest, higher)):
        if are_units(units, names) and not are_units(names):
            return place, names, {k: unit for k, cell in enumerate(units) if (unit := bare_unit(cell))}
    (place, below), (_, above) = nearest, higher
    mixed = {k: unit for k, cell in enumerate(below) if is_unit_of(unit := bare_unit(cell), above[k])}
    if len(mixed) == len(below):
        return place, below, {}
    # a unit below the name of the time, names below the numbers of channels
    return place, [above[k] if k in mixed else cell for k, cell in enumerate(below)], mixed


def cells_in(line: str, form: TextForm) -> tuple[str, ...]:
    """The cells of a header, behind what a comment begins with."""
    return tuple(cells_of(line.lstrip().removeprefix(form.comment), form))


def _names_in(line: str, form: TextForm, columns: int, is_nearest: bool) -> list[str]:
    """The names of this many columns that a line holds, in the file's cells or as a script writes a list; or none.

    The line next to the numbers may have another delimiter than they.
    """
    for names in ways(line, form, is_nearest):
        is_short = len(names) == columns - 1 and (line.rstrip(" \r").endswith(form.delimiter) or are_units(names))
        padded = [*names, *[""] * is_short]  # a last one that is empty, as of a unit of words
        if len(padded) == columns and not (columns == 1 and _is_list(line, form)):
            return padded
    return []


def _is_list(line: str, form: TextForm) -> bool:
    """True of a line that holds several names, and not one with its unit: `Angle, deg`."""
    others = [names for names in ways(line, form, True) if len(names) > 1]
    return any(len(names) > 2 or known_unit(bare_unit(names[1]), tuple(UNITS)) is None for names in others)


def ways(line: str, form: TextForm, others: bool) -> list[list[str]]:
    """Ways to read names in a line: a list of a script, the file's cells, and with `others` other delimiters too."""
    text = line.strip().removeprefix(form.comment).strip()
    if not text:
        return []
    separators = [s for s in (",", ";", "\t") if s != form.delimiter and s in text] if others else []
    parted = [[n.strip(" \"'") for n in text.rstrip(f"{s} ").split(s)] for s in separators]
    own = [list(cells_in(line, form))]
    if form.delimiter == " ":  # names that hold a blank stand in columns: `TIME   POS (ANAT)`
        own += [re.split(r"\t|\s{2,}", text)] if re.search(r"\t|\s{2,}", text) else []
    return _script_list(text) + (parted + own if form.delimiter == " " else own + parted)


def _script_list(text: str) -> list[list[str]]:
    """The names of a list as a script writes it, `names = ['t', 'F']`; none of a row of units, `[s],[deg]`."""
    found = re.match(r"^(?:\w+\s*=\s*)?[\[(](.*)[\])]$", text)
    if found is None:
        return []
    inner = found[1].strip()
    if inner[:1] in ("'", '"') and (quoted := re.findall(r"(['\"])(.*?)\1", inner)):
        return [[name for _, name in quoted]]
    return [[n.strip() for n in inner.split(",")]] if "," in inner and not re.search(r"[\[\]()]", inner) else []


def _too_few(lines: Sequence[str], form: TextForm, columns: int, keyed: set[int]) -> tuple[str, ...]:
    """A sentence about the nearest line of words, where it holds other than one name a column; none of a title."""
    for place in range(len(lines) - 1, -1, -1):
        text = lines[place].strip()
        if place in keyed or not re.search(r"[^\W\d_]", text):
            continue
        count = max((len(names) for names in ways(lines[place], form, True)), default=0)
        if count < 2 or count == columns or (form.comment and text.startswith(form.comment)):
            return ()
        over = f"{columns} column{'s' * (columns > 1)}"
        how = f"--names {','.join('abcdefghij'[:columns])} says which" if columns <= 10 else "--names says which"
        return (f"line {place + 1} has {count} names over {over}, which are called column1 ...: {how}",)
    return ()


def _keyed(lines: Sequence[str], form: TextForm, columns: int) -> list[tuple[int, str, list[str]]]:
    """Lines that begin with a key, and pairs of a line of names and one of their numbers below: row, kind, cells."""
    out, before = [], (-1, [""])
    for place, line in enumerate(lines):
        text = line.strip().removeprefix(form.comment).strip()
        in_two = [c.strip(" \"'") for c in re.split(r"[=:]|,|;|\t", text, maxsplit=1)]
        for cells in (list(cells_in(line, form)), in_two):
            key, unit = split_header((cells or [""])[0].rstrip("=: "))
            kind = _kind_of(key) if len(cells) > 1 else ""
            if kind and (cells is not in_two) >= (kind in ("names", "units")):
                out.append((place, kind, [unit, *cells[1:]]))
        other = next((c for c in ways(line, form, True) if len(c) > 1), [])
        if len(other) == len(before[1]) > 1 and len(other) != columns and all(map(NUMBER.match, other)):
            for name, value in zip(before[1], other, strict=True):
                if (kind := _kind_of(split_header(name)[0])) in ("interval", "rate"):
                    out.append((place, kind, [split_header(name)[1], value]))
        before = (place, other)
    return out


def is_keyed(cells: Sequence[str]) -> bool:
    """True of a line that begins with a key: `Interval,0.5`, `BottomValue=,-10`."""
    key = cells[0] if cells else ""
    return key.endswith(("=", ":")) or bool(_kind_of(split_header(key.rstrip("=: "))[0]))


def _kind_of(key: str) -> str:
    plain = re.sub(r"[\s_]+", " ", key).strip().lower()
    return next((kind for kind, words in _KEYS.items() if words.match(plain)), "")


def _rate(kind: str, cells: Sequence[str]) -> float | None:
    """The sample rate, Hz, that a line of a key says; None of one that says none."""
    if kind not in ("interval", "rate"):
        return None
    text, _, after = cells[1].strip(" ,;\t").partition(" ")
    unit = after.strip() or cells[0]
    quantity, plain = ("time", "s") if kind == "interval" else ("frequency", "Hz")
    known = known_unit(unit or plain, (quantity,))
    if not NUMBER.match(text) or known is None:
        return None
    value = float(text) * UNITS[quantity][known[1]]
    if not (value > 0.0 and math.isfinite(value)):
        return None
    return float(f"{1.0 / value:.12g}") if kind == "interval" else value


def _from_keys(
    keyed: Sequence[tuple[int, str, list[str]]], numbers: Sequence[Sequence[str]], rate: float | None
) -> Header | None:
    """Names of a line with a key, as `Channel name`, where another line states units or an interval."""
    rows = {kind: (place, cells[1:]) for place, kind, cells in reversed(keyed)}
    if "names" not in rows or ("units" not in rows and rate is None):
        return None
    place, names = rows["names"]
    ahead = len(numbers[0]) - len(names)
    if ahead not in (0, 1):
        return None
    units = [bare_unit(cell) for cell in rows.get("units", (0, []))[1][: len(names)]]
    stated = {k: unit for k, unit in enumerate(units, ahead) if unit}
    if ahead and (unit := _counts_in(numbers, rate)):
        return Header(place + 1, ("Time", *names), {0: unit, **stated})
    return Header(place + 1, (*[""] * ahead, *names), stated)


def _counts_in(numbers: Sequence[Sequence[str]], rate: float | None) -> str:
    """The unit in which a first column counts the samples of a rate; "" of one that does not."""
    firsts = [row[0].replace(",", ".") for row in numbers]
    if rate is None or len(firsts) < 2 or not all(map(NUMBER.match, firsts)):
        return ""
    return unit_of_step(float(firsts[1]) - float(firsts[0]), rate)


def unit_of_step(step: float, rate_hz: float) -> str:
    """The unit of times, s or ms, in which a step is that of a rate; "" where it is in neither."""
    units = UNITS["time"]
    return next((u for u in ("s", "ms") if math.isclose(step * units[u] * rate_hz, 1.0, rel_tol=0.02)), "")


def _rate_of_frames(lines: Sequence[str], form: TextForm, names: Sequence[str]) -> float | None:
    """A number that stands alone above columns of frames and subframes is their rate: so a motion-capture program."""
    if not {name.lower().replace(" ", "") for name in names[:2]} >= {"frame", "subframe"}:
        return None
    alone = [cells[0] for line in lines if len(cells := [c for c in cells_in(line, form) if c]) == 1]
    rates = [float(cell) for cell in alone if NUMBER.match(cell) and float(cell) > 0.0]
    return rates[-1] if rates else None
