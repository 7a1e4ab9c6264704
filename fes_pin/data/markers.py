"""Marker positions: .trc and .csv files, and C3D files if ezc3d is installed."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.files import read_text
from fes_pin.data.table import read_csv

METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
"""What the units of a file are in metres."""


@dataclass(frozen=True)
class Markers:
    """Marker positions in the laboratory's frame.

    Attributes
    ----------
    time
        (n,) s.
    places
        By marker, (n, 3) m; NaN where a marker was not seen.
    """

    time: np.ndarray = field(repr=False)
    places: dict[str, np.ndarray]


def read_markers(path: str | Path) -> Markers:
    """Read marker positions by the file's suffix: .trc, .c3d, or .csv with `<marker>_x`, `_y`, `_z` in m.

    Raises
    ------
    InputError
        What the file holds is not what its format says, with row and column; C3D without ezc3d.
    """
    path = Path(path)
    read = {".trc": _read_trc, ".c3d": _read_c3d, ".csv": _read_csv}.get(path.suffix.lower())
    if read is None:
        raise InputError("expected a .trc, .c3d or .csv file of markers", file=path)
    return read(path)


def _read_csv(path: Path) -> Markers:
    table = read_csv(path)
    if table.names[0] not in ("time", "time_s"):
        raise table.error(f"expected time_s or time as the first column, found {table.names[0][:40]}", "time_s")
    markers = dict.fromkeys(n[:-2] for n in table.names[1:] if n[-2:] in ("_x", "_y", "_z"))
    if not markers:
        raise table.error("expected columns <marker>_x, <marker>_y, <marker>_z", table.names[-1])
    for name in markers:
        for axis in "xyz":
            if f"{name}_{axis}" not in table.names:
                raise table.error("missing", f"{name}_{axis}")
    places = {n: np.stack([table.column(f"{n}_{c}") for c in "xyz"], axis=1) for n in markers}
    return Markers(table.column(table.names[0]), places)


def _read_trc(path: Path) -> Markers:
    """Three lines of header, marker names over every third column, X1 Y1 Z1 ..., then the numbers; tabs between."""
    lines = read_text(path).split("\n")
    if len(lines) < 6 or not lines[0].startswith("PathFileType"):
        raise InputError("expected a .trc file that begins with PathFileType", file=path, row=1)
    keys, values = lines[1].split(), lines[2].split()
    header = dict(zip(keys, values, strict=False))
    unit = header.get("Units", "").lower()
    if unit not in METRES:
        raise InputError(f"expected Units of m, cm or mm, found {unit[:20]!r}", file=path, row=3, column="Units")
    names = [n.strip() for n in lines[3].split("\t")[2:] if n.strip()]
    if not names:
        raise InputError("expected marker names after Frame# and Time", file=path, row=4)
    rows, time = [], []
    for index, line in enumerate(lines[5:]):
        if not line.strip():
            continue
        cells = line.split("\t")[: 2 + 3 * len(names)]
        numbers = [_number(cell, path, 6 + index, names, k) for k, cell in enumerate(cells)]
        numbers += [np.nan] * (2 + 3 * len(names) - len(numbers))
        time.append(numbers[1])
        rows.append(numbers[2:])
    _check_rows(path, header.get("NumFrames"), len(rows), np.array(time))
    table = METRES[unit] * np.array(rows).reshape(len(rows), len(names), 3)
    return Markers(np.array(time), {n: table[:, k] for k, n in enumerate(names)})


def _number(cell: str, path: Path, row: int, names: list[str], place: int) -> float:
    label = ("Frame#", "Time")[place] if place < 2 else f"{names[(place - 2) // 3]}.{'XYZ'[(place - 2) % 3]}"
    if not cell.strip():
        if place < 2:
            raise InputError("expected a number, found nothing", file=path, row=row, column=label)
        return float("nan")
    try:
        return float(cell)
    except ValueError:
        raise InputError(f"expected a number, found {cell[:40]!r}", file=path, row=row, column=label) from None


def _check_rows(path: Path, promised: str | None, count: int, time: np.ndarray) -> None:
    if promised is not None and promised != str(count):
        raise InputError(f"expected {promised[:20]} frames as NumFrames says, found {count}", file=path, row=3)
    if count < 3:
        raise InputError(f"expected at least 3 frames, found {count}", file=path, row=6)
    late = np.flatnonzero(~(np.diff(time) > 0.0))
    if len(late):
        raise InputError("expected time to increase", file=path, row=7 + int(late[0]), column="Time")


def _read_c3d(path: Path) -> Markers:
    """Points of a C3D file, in m; points that were not seen are NaN."""
    try:
        import ezc3d  # noqa: PLC0415
    except ImportError:
        raise InputError("C3D files need ezc3d: pip install 'fes-pin[c3d]'", file=path) from None
    if not path.is_file():
        raise InputError("no such file", file=path)
    try:
        recording = ezc3d.c3d(str(path))
    except Exception as error:
        raise InputError(f"cannot be read as C3D: {str(error)[:80]}", file=path) from None
    point = recording["parameters"]["POINT"]
    labels = list(point["LABELS"]["value"])
    units = [str(u).lower() for u in point.get("UNITS", {}).get("value", [])]
    if not labels or not units or units[0] not in METRES:
        found = units[0][:20] if units else "nothing"
        raise InputError(f"expected points with UNITS of m, cm or mm, found {found!r}", file=path)
    data = METRES[units[0]] * np.asarray(recording["data"]["points"], dtype=float)[:3]
    rate = float(recording["header"]["points"]["frame_rate"])
    time = np.arange(data.shape[2]) / rate
    return Markers(time, {name: data[:, k].T.copy() for k, name in enumerate(labels)})
