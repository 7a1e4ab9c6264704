"""Vectors in files that nest them, as `.mat` and `.json`: by dotted names, those of one length, with their rates."""

import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fes_pin.data.errors import MOST_LISTED, InputError, listed
from fes_pin.data.files import read_bytes, read_json, read_json_lines
from fes_pin.data.recorded.elements import elements_in, of_one_length, units_in
from fes_pin.data.recorded.libraries import library, made, read_apart, reading
from fes_pin.data.recorded.matlab_exports import with_names
from fes_pin.data.table import MIN_ROWS, Table

OFFERED = 4
"""Vectors of a length that are listed: a time and three quantities."""


def matlab_vectors(path: Path) -> dict[str, np.ndarray]:
    """Every vector of numbers in a MATLAB file, by dotted names: `log.angle`, `cells.2`, `table.1` (a column).

    Raises
    ------
    InputError
        Not a MATLAB file, hardly more than objects of a class, or pymatreader is not installed.
    """
    return _found_in(path).columns


class _Found(NamedTuple):
    """Vectors by dotted names, rates of samples by the structure that states them, Hz, units, and what is no vector."""

    columns: dict[str, np.ndarray]
    rates: tuple[tuple[str, float], ...]
    units: dict[str, str]
    left: tuple[str, ...]

    def rate_hz(self, names: Collection[str]) -> float | None:
        """The only rate that is stated of some vectors, next to them or above them; None where there is none."""
        rates = {rate for above, rate in self.rates if not above or any(n.startswith(f"{above}.") for n in names)}
        return rates.pop() if len(rates) == 1 else None


def _found_in(path: Path, sheet: str = "") -> _Found:
    """Every vector of numbers in a file that nests them, or in one of its structures.

    Of JSON a list of records has a vector of each key, and a null among numbers is a missing sample.
    """
    content, is_odd = _read_once(path, read_bytes(path))
    if sheet:
        parts = dict(elements_in(content))
        if sheet not in parts:
            expected = f"expected one of its structures, {listed([*parts])}" if parts else "it has no structures"
            raise InputError(f"{expected}; found {sheet[:40]!r}", file=path, column="sheet")
        content = with_names(parts[sheet])
    found = dict(_vectors(content))
    if is_odd and len(found) < 2:  # no time with a quantity
        words = "expected arrays of numbers; objects of a class, as timeseries and table, are not read"
        raise InputError(f"{words}: save their times and data as arrays", file=path)
    rates = []
    for name, value in _scalars(content):
        above, _, last = name.rpartition(".")
        if 0.0 < value < math.inf and (SAMPLED.match(last) or STEP.match(last)):
            rates.append((above, value if SAMPLED.match(last) else float(f"{1.0 / value:.12g}")))
    found, left = of_one_length(found)
    return _Found(found, tuple(rates), units_in(content, found), (*left, *_too_deep(content)))


@lru_cache(maxsize=2)
def _read_once(path: Path, content: bytes) -> tuple[Any, bool]:
    """What a file nests, which is read once for all of its trials while it holds the same bytes."""
    found, is_odd = NESTED[path.suffix.lower()](path)
    return with_names(found), is_odd


def elements_of(path: Path) -> tuple[str, ...]:
    """Names of the structures of a file that nests vectors; none of others. Each is read as a sheet is.

    Raises
    ------
    InputError
        As `matlab_vectors`; not a JSON file.
    """
    if not is_nested(path):
        return ()
    content, _ = _read_once(path, read_bytes(path))
    return tuple(dict.fromkeys(n for n, one in elements_in(content) if any(_vectors(one))))


def _matlab(path: Path) -> tuple[Any, bool]:
    """What a MATLAB file holds, and whether it holds objects of a class as well."""
    library("pymatreader", "matlab", path)
    with reading(path, "a MATLAB file"):
        found, warned = read_apart("pymatreader", "read_mat", path)
    content = {key: one for key, one in found.items() if not str(key).startswith("#")}
    return _in_order(content) if HDF5 in read_bytes(path)[:1024] else content, warned > 0


def _in_order(content: Any) -> Any:
    """What an HDF5 file nests, by name, where `trial2` is before `trial10`: its reader gives names in any order."""
    if isinstance(content, list):
        return [_in_order(one) for one in content]
    if not isinstance(content, dict):
        return content
    return {name: _in_order(content[name]) for name in sorted(content, key=_by_number)}


def _by_number(name: str) -> list[tuple[int, str]]:
    return [(int(one), "") if one.isdecimal() else (-1, one) for one in re.findall(r"\d+|\D+", name)]


def _of_records(content: Any) -> Any:
    """JSON with its lists of records as tables of lists, and null among numbers as NaN."""
    if isinstance(content, dict):
        return {key: _of_records(value) for key, value in content.items()}
    if not isinstance(content, list):
        return content
    if len(content) >= MIN_ROWS and all(isinstance(one, dict) for one in content):
        return {key: _of_key([one.get(key) for one in content]) for key in content[0]}
    if all(one is None or isinstance(one, int | float) for one in content):
        return [np.nan if one is None else one for one in content]
    return [_of_records(one) for one in content]


def _of_key(values: list[Any]) -> Any:
    """What records hold under a key: of lists of numbers, as many in each record, an array with a row a record."""
    widths = {len(one) if isinstance(one, list) else 0 for one in values}
    if len(widths) == 1 and 0 not in widths and all(isinstance(x, int | float) for one in values for x in one):
        return np.array(values, dtype=float)
    return _of_records(values)


NESTED: Mapping[str, Callable[[Path], tuple[Any, bool]]] = {
    ".mat": _matlab,
    ".json": lambda path: (_of_records(read_json(path)), False),
    **dict.fromkeys((".jsonl", ".ndjson"), lambda path: (_of_records(read_json_lines(path)), False)),
}
"""What files hold that nest vectors, by suffix."""
HDF5 = b"\x89HDF\r\n\x1a\n"
"""How an HDF5 file begins, after a block of 512 bytes where MATLAB wrote it."""
SAMPLED = re.compile(r"(?i)(fs|fsamp|sfreq|srate|frame_?rate|samp[a-z]*_?(rate|freq[a-z]*)|f_?sampl[a-z]*)(_?hz)?$")
"""Names of a number that is the rate of the samples."""
SHORT = 0.02
"""Share of the longest length that several vectors have, up to which others are no recording but marks and settings: a
motion at 50 Hz next to an EMG at 2 kHz has 0.025."""
STEP = re.compile(r"(?i)(interval|dt|delta_?t|samp[a-z]*_?(interval|time|period))(_?s)?$")
"""Names of a number that is the time from one sample to the next, s; `interval` is Spike2's."""


def is_nested(path: Path) -> bool:
    """Return whether a file nests vectors of several lengths."""
    return path.suffix.lower() in NESTED


def nested_table(path: Path, wanted: Sequence[str] | None, sheet: str = "") -> Table:
    """Return vectors of one length of a file or of one of its structures; those that are wanted may have others.

    Raises
    ------
    InputError
        As `matlab_vectors`; nothing but arrays of more than two dimensions; the structure is not there.
    """
    columns, _, units, left = _found_in(path, sheet)
    if left and not columns:
        raise InputError(left[0], file=path)
    if wanted is None and columns:  # scalars and tables of other lengths are no columns of the recording
        count = _usual_length(columns)
        columns = {n: v for n, v in columns.items() if len(v) == count}
    whole = made(path, columns, wanted, said=left)
    return replace(whole, units={n: u for n, u in units.items() if n in whole.names})


def by_length(
    path: Path, chosen: Collection[str], sheet: str = ""
) -> tuple[tuple[str, ...], float | None, tuple[str, ...]]:
    """Names of vectors of one length in a file that nests them, their rate, and a sentence about others.

    Parameters
    ----------
    chosen
        What a person says of columns: a vector's name begins it, and decides the length; else the most have it.
    sheet
        One of its structures; "" for the whole file.

    Returns
    -------
    names : tuple of str
    rate_hz : float or None
        Of the samples, where the file states it: `fs`, `SampleRate`, `interval`.
    said : tuple of str
        Of other vectors that go together, or are as long.

    Raises
    ------
    InputError
        As `matlab_vectors`; not a JSON file.
    """
    found = _found_in(path, sheet)
    columns = found.columns
    groups = _by_length(columns)
    asked = [n for n in columns if any(words == n or words.startswith((f"{n}:", f"{n},")) for words in chosen)]
    count = len(columns[asked[0]]) if asked else _usual_length(columns)
    names = tuple(groups.get(count, ()))
    others = {n: some for n, some in groups.items() if n != count and (len(some) > 1 or 2 * n >= count)}
    if not others:
        return names, found.rate_hz(names), ()
    parts = "; ".join(f"{n} samples: {_few(names)}" for n, names in list(others.items())[:MOST_LISTED])
    more = f" ... and {len(others) - MOST_LISTED} lengths more" if len(others) > MOST_LISTED else ""
    first = next(iter(others.values()))[0]
    how = f"--column COLUMN={first} takes those of its length"
    return names, found.rate_hz(names), (f"vectors of {count} samples are taken; there are also {parts}{more}; {how}",)


def _by_length(columns: Mapping[str, np.ndarray]) -> dict[int, list[str]]:
    groups: dict[int, list[str]] = {}
    for name, values in columns.items():
        groups.setdefault(len(values), []).append(name)
    return groups


def _usual_length(columns: Mapping[str, np.ndarray]) -> int:
    """The length that most vectors have; where none has another's, the longest.

    Members of one list that differ in length, as the times of events by unit, are no columns of a recording.
    """
    lists: dict[str, set[int]] = {}
    for name, values in columns.items():
        if name.rpartition(".")[2].isdigit():
            lists.setdefault(name.rpartition(".")[0], set()).add(len(values))
    alike = {n: v for n, v in columns.items() if len(lists.get(n.rpartition(".")[0], ())) < 2} or columns
    groups = _by_length(alike)
    longest = max((n for n, names in groups.items() if len(names) > 1), default=0)
    groups = {n: names for n, names in groups.items() if n > SHORT * longest}
    return max(groups, key=lambda n: (len(groups[n]), n if len(groups[n]) == 1 else 0), default=0)


def _few(names: Sequence[str]) -> str:
    more = f" and {len(names) - OFFERED} more" if len(names) > OFFERED else ""
    return ", ".join(names[:OFFERED]) + more


def _vectors(content: Any, name: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """Vectors of numbers in nested structures, by dotted names; columns of a matrix are counted from 1."""
    if isinstance(content, Mapping):
        for key, value in content.items():
            if not str(key).startswith("__"):
                yield from _vectors(value, f"{name}.{key}" if name else str(key))
        return
    if isinstance(content, list) and not all(isinstance(x, int | float) for x in content):
        for place, value in enumerate(content, 1):
            yield from _vectors(value, f"{name}.{place}")
        return
    yield from _of_array(content, name)


def _of_array(content: Any, name: str) -> Iterator[tuple[str, np.ndarray]]:
    """A vector of numbers, or the columns of a matrix, by name; none of what is too short or no array of numbers."""
    try:
        values = np.asarray(content)
    except ValueError:
        return
    values = values.squeeze() if values.ndim > 2 else values
    if values.dtype.kind not in "biuf" or values.size < MIN_ROWS or values.ndim > 2:
        return
    if values.ndim == 1 or 1 in values.shape:
        yield name, values.astype(float).ravel()
        return
    table = values if values.shape[0] >= values.shape[1] else values.T
    for place, column in enumerate(table.T, 1):
        yield f"{name}.{place}", column.astype(float)


def _too_deep(content: Any, name: str = "") -> Iterator[str]:
    """A sentence about each array of more than two dimensions, none of which says that it is the time."""
    if isinstance(content, Mapping | list):
        pairs = content.items() if isinstance(content, Mapping) else enumerate(content, 1)
        for key, value in pairs:
            yield from _too_deep(value, f"{name}.{key}" if name else str(key))
    elif isinstance(content, np.ndarray) and content.dtype.kind in "biuf" and content.squeeze().ndim > 2:
        shape = " x ".join(map(str, content.shape))
        yield f"{name} ({shape}) is left out: vectors and matrices are read; save each of its pages as a matrix"


def _scalars(content: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """Single numbers in nested structures, by dotted names."""
    if isinstance(content, Mapping):
        for key, value in content.items():
            if not str(key).startswith("__"):
                yield from _scalars(value, f"{name}.{key}" if name else str(key))
    elif isinstance(content, int | float | np.number) and not isinstance(content, bool):
        yield name, float(content)
