"""Recordings in files that are no plain text: each by the library that its community keeps, as an extra.

| suffix | library | extra |
|---|---|---|
| `.parquet` | pyarrow | `parquet` |
| `.mat` | pymatreader (scipy and h5py) | `matlab` |
| `.c3d` | ezc3d | `c3d` |
| `.xdf`, `.xdfz` | pyxdf | `xdf` |
| `.xlsx`, `.xls`, `.ods` ... | python-calamine | `spreadsheet` |
| `.mot`, `.sto`, `.trc`, `.json` | none | |
"""

import re
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fes_pin.data.errors import MOST_LISTED, InputError, listed, optional_library
from fes_pin.data.files import as_path, read_bytes, read_json
from fes_pin.data.markers import TIME, c3d_points, trc_points
from fes_pin.data.motion import STORAGE, is_rotation, read_motion
from fes_pin.data.recorded.clock import since_first
from fes_pin.data.recorded.elements import elements_in, of_one_length, units_in
from fes_pin.data.recorded.form import TextForm
from fes_pin.data.recorded.matlab_exports import with_names
from fes_pin.data.recorded.text import read_text_recording, without_twins
from fes_pin.data.table import MIN_ROWS, Table

OFFERED = 4
"""Vectors of a length that are listed: a time and three quantities."""
UNREADABLE = {
    ".numbers": "a spreadsheet of Numbers; save it as .xlsx or CSV",
    **dict.fromkeys((".pkl", ".pickle"), "a pickle, which runs code when it is read; save it as CSV or Parquet"),
    **dict.fromkeys((".zip", ".gz", ".7z"), "an archive; unpack it first"),
}
"""Suffixes of files that are not read, and what to do instead."""


def is_text(path: Path) -> bool:
    """Return whether a file is read as text, by its suffix: a spreadsheet's sheet is."""
    return path.suffix.lower() not in {*_READERS, *UNREADABLE}


def check_suffix(path: Path) -> None:
    """Refuse a file of a kind that is not read, by its suffix.

    Raises
    ------
    InputError
        With what to do instead.
    """
    if why := UNREADABLE.get(path.suffix.lower()):
        raise InputError(f"this is {why}", file=path)


def read_recording(path: str | Path, form: TextForm | None = None, wanted: Sequence[str] | None = None) -> Table:
    """Read some columns of a recording by its suffix; what is none of those above is text.

    Parameters
    ----------
    form
        Of a text file; without it that of the study format.
    wanted
        Names of columns; None for all that are numbers.

    Raises
    ------
    InputError
        The file is not what its suffix says, a library is not installed, or no file of this kind can be read; the
        message says what to do.
    """
    path = as_path(path)
    suffix = path.suffix.lower()
    check_suffix(path)
    if suffix not in _READERS:
        return since_first(read_text_recording(path, form or TextForm(), wanted))
    read_bytes(path)  # their libraries open it themselves
    sheet = form.sheet if form else ""
    recording = _nested(path, wanted, sheet) if is_nested(path) else _READERS[suffix](path, wanted)
    sizes = {len(values) for values in recording.columns.values()}
    if len(sizes) > 1:
        lengths = ", ".join(f"{name} {len(values)}" for name, values in recording.columns.items())
        raise InputError(f"expected columns of one length, found {lengths[:200]}", file=path)
    if not sizes or min(sizes) < MIN_ROWS:
        raise InputError(f"expected at least {MIN_ROWS} samples of numbers, found {min(sizes, default=0)}", file=path)
    for name, values in recording.columns.items():
        if np.isinf(values).any():
            raise recording.error("expected a finite number", name, int(np.argmax(np.isinf(values))))
    return since_first(recording)


def _library(module: str, extra: str, path: Path) -> Any:
    needed = f"{path.suffix} files need {module.split('.', maxsplit=1)[0]}"
    return optional_library(module, extra, needed, file=path)


@contextmanager
def _reading(path: Path, kind: str) -> Iterator[None]:
    """What a library cannot read is an input error."""
    try:
        yield
    except Exception as error:
        raise InputError(f"cannot be read as {kind}: {' '.join(str(error).split())[:120]}", file=path) from None


def _made(path: Path, columns: Mapping[str, np.ndarray], wanted: Sequence[str] | None, **more: Any) -> Table:
    """A recording of columns, of which only those that are wanted must be of one length; others are no part of it."""
    chosen = columns if wanted is None else {n: v for n, v in columns.items() if n in wanted}
    count = max((len(v) for v in chosen.values()), default=0)
    names = tuple(n for n, v in columns.items() if n in chosen or len(v) == count)
    return Table(path, names, chosen, np.arange(1, count + 1), **more)


def _parquet(path: Path, wanted: Sequence[str] | None) -> Table:
    parquet = _library("pyarrow.parquet", "parquet", path)
    types = _library("pyarrow.types", "parquet", path)
    with _reading(path, "Parquet"):
        table = parquet.read_table(path)
    columns: dict[str, np.ndarray] = {}
    for name, column in zip(without_twins(list(table.column_names)), table.columns, strict=True):
        kind = column.type
        if types.is_timestamp(kind):  # seconds from the first one
            ticks = column.to_numpy().astype("datetime64[ns]").astype(np.int64)
            columns[name] = 1e-9 * (ticks - ticks[:1])
        elif types.is_integer(kind) or types.is_floating(kind) or types.is_boolean(kind):
            columns[name] = np.array(column.cast("float64").to_numpy(), dtype=float)
    return _made(path, columns, wanted)


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
    content, is_odd = _content(path, read_bytes(path))
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
        if value > 0.0 and (SAMPLED.match(last) or STEP.match(last)):
            rates.append((above, value if SAMPLED.match(last) else float(f"{1.0 / value:.12g}")))
    found, left = of_one_length(found)
    return _Found(found, tuple(rates), units_in(content, found), (*left, *_too_deep(content)))


@lru_cache(maxsize=2)
def _content(path: Path, _content: bytes) -> tuple[Any, bool]:
    """What a file nests; it is read once for all of its trials."""
    content, is_odd = _NESTED[path.suffix.lower()](path)
    return with_names(content), is_odd


def elements_of(path: Path) -> tuple[str, ...]:
    """Names of the structures of a file that nests vectors; none of others. Each is read as a sheet is.

    Raises
    ------
    InputError
        As `matlab_vectors`; not a JSON file.
    """
    if not is_nested(path):
        return ()
    return tuple(dict.fromkeys(n for n, one in elements_in(_content(path, read_bytes(path))[0]) if any(_vectors(one))))


def _matlab(path: Path) -> tuple[Any, bool]:
    """What a MATLAB file holds, and whether it holds objects of a class as well."""
    reader = _library("pymatreader", "matlab", path)
    with _reading(path, "a MATLAB file"), warnings.catch_warnings(record=True) as objects:
        warnings.simplefilter("always")
        content = {key: one for key, one in reader.read_mat(str(path)).items() if not str(key).startswith("#")}
    return content, bool(objects)


def _of_records(content: Any) -> Any:
    """JSON with its lists of records as tables of lists, and null among numbers as NaN."""
    if isinstance(content, dict):
        return {key: _of_records(value) for key, value in content.items()}
    if not isinstance(content, list):
        return content
    if len(content) >= MIN_ROWS and all(isinstance(one, dict) for one in content):
        return {key: _of_records([one.get(key) for one in content]) for key in content[0]}
    if all(one is None or isinstance(one, int | float) for one in content):
        return [np.nan if one is None else one for one in content]
    return [_of_records(one) for one in content]


_NESTED: Mapping[str, Callable[[Path], tuple[Any, bool]]] = {
    ".mat": _matlab,
    ".json": lambda path: (_of_records(read_json(path)), False),
}
"""What files hold that nest vectors, by suffix."""
SAMPLED = re.compile(r"(?i)(fs|fsamp|sfreq|srate|frame_?rate|samp[a-z]*_?(rate|freq[a-z]*)|f_?sampl[a-z]*)(_?hz)?$")
"""Names of a number that is the rate of the samples."""
SHORT = 0.02
"""Share of the longest length that several vectors have, up to which others are no recording but marks and settings: a
motion at 50 Hz next to an EMG at 2 kHz has 0.025."""
STEP = re.compile(r"(?i)(interval|dt|delta_?t|samp[a-z]*_?(interval|time|period))(_?s)?$")
"""Names of a number that is the time from one sample to the next, s; `interval` is Spike2's."""


def is_nested(path: Path) -> bool:
    """Return whether a file nests vectors of several lengths."""
    return path.suffix.lower() in _NESTED


def _nested(path: Path, wanted: Sequence[str] | None, sheet: str = "") -> Table:
    columns, _, units, left = _found_in(path, sheet)
    if left and not columns:
        raise InputError(left[0], file=path)
    if wanted is None and columns:  # scalars and tables of other lengths are no columns of the recording
        count = _usual_length(columns)
        columns = {n: v for n, v in columns.items() if len(v) == count}
    whole = _made(path, columns, wanted, said=left)
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


def _c3d(path: Path, wanted: Sequence[str] | None) -> Table:
    """Analog channels at their rate; where only points are wanted, `<marker>_x`, `_y`, `_z` in m at theirs."""
    ezc3d = _library("ezc3d", "c3d", path)
    with _reading(path, "C3D"):
        content = ezc3d.c3d(str(path))
        about = content["parameters"]["ANALOG"]
        labels = without_twins([str(n).strip() for n in about.get("LABELS", {}).get("value", [])])
        units = [str(u).strip() for u in about.get("UNITS", {}).get("value", [])]
        values = np.asarray(content["data"]["analogs"], dtype=float)[0]
        rate = float(content["header"]["analogs"]["frame_rate"])
    analog = dict(zip(labels, values, strict=False)) if values.size else {}
    points = c3d_points(content, path) if content["data"]["points"].size else {}
    names = (TIME, *analog, *(n for n in points if n != TIME))
    if analog and (wanted is None or set(wanted) & set(analog)):
        columns = {TIME: np.arange(values.shape[1]) / rate, **analog}
        stated = {**dict(zip(labels, units, strict=False)), TIME: "s"}
    else:
        columns, stated = points, dict.fromkeys(points, "m") | {TIME: "s"}
    return replace(_made(path, columns, wanted, units=stated), names=names)


def _trc(path: Path, wanted: Sequence[str] | None) -> Table:
    columns = trc_points(path)
    return _made(path, columns, wanted, units=dict.fromkeys(columns, "m") | {TIME: "s"})


def _storage(path: Path, wanted: Sequence[str] | None) -> Table:
    table, in_degrees = read_motion(path)
    units = {} if in_degrees is None else {n: "deg" if in_degrees else "rad" for n in table.names if is_rotation(n)}
    return _made(path, table.columns, wanted, units={**units, table.names[0]: "s"}, said=table.said)


def _xdf(path: Path, wanted: Sequence[str] | None) -> Table:
    """Streams of numbers, `<stream>.<channel>` where there are several; each has its own times."""
    pyxdf = _library("pyxdf", "xdf", path)
    if read_bytes(path)[:4] not in (b"XDF:", b"\x1f\x8b\x08\x00", b"\x1f\x8b\x08\x08"):
        raise InputError("cannot be read as XDF: it does not begin as one", file=path)  # pyxdf would leave it open
    with _reading(path, "XDF"):
        streams, _ = pyxdf.load_xdf(str(path))
        numbers = [s for s in streams if np.asarray(s["time_series"]).dtype.kind in "iuf" and len(s["time_stamps"])]
        named = [(str(s["info"]["name"][0]), s, _channels(s)) for s in numbers]
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    for name, stream, channels in named:
        before = f"{name}." if len(named) > 1 else ""
        values = np.asarray(stream["time_series"], dtype=float)
        columns[f"{before}{TIME}"] = np.asarray(stream["time_stamps"], dtype=float)
        units[f"{before}{TIME}"] = "s"
        for k, (label, unit) in enumerate(channels):
            columns[f"{before}{label}"] = values[:, k]
            units |= {f"{before}{label}": unit} if unit else {}
    return _made(path, columns, wanted, units=units)


def _channels(stream: Any) -> list[tuple[str, str]]:
    """Label and unit of each channel; numbers from 1 where the stream does not say."""
    count = np.asarray(stream["time_series"]).shape[1]
    described: list[Any] = []
    for place in ((stream["info"].get("desc") or [None])[0] or {}).get("channels", []):
        described = (place or {}).get("channel", [])
    labels = without_twins([str((c.get("label") or [""])[0] or "") for c in described] or [""] * count)
    units = [str((c.get("unit") or [""])[0] or "") for c in described] or [""] * count
    return list(zip(labels, units, strict=True))[:count]


_READERS: Mapping[str, Callable[[Path, Sequence[str] | None], Table]] = {
    **{".parquet": _parquet, **dict.fromkeys(_NESTED, _nested), ".c3d": _c3d, ".trc": _trc},
    **{**dict.fromkeys(STORAGE, _storage), **dict.fromkeys((".xdf", ".xdfz"), _xdf)},
}
