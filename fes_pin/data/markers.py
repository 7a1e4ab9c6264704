"""Marker positions: .trc and .csv files, and C3D files if ezc3d is installed."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.files import read_text
from fes_pin.data.libraries import optional_library
from fes_pin.data.recorded.text import TextForm, read_csv, table_of_lines

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
    return Markers(table.time, {n: np.stack([table.columns[f"{n}_{c}"] for c in "xyz"], axis=1) for n in markers})


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
    cells = ("Frame#", "Time", *(f"{name}.{axis}" for name in names for axis in "XYZ"))
    lines[5:] = ["\t".join(line.split("\t")[: len(cells)]) for line in lines[5:]]  # what is behind them is no marker
    table = table_of_lines(path, lines, cells, TextForm("\t", header_row=4, first_row=6))
    time = table.columns["Time"]
    if (promised := header.get("NumFrames")) not in (None, str(len(table))):
        raise InputError(f"expected {promised[:20]} frames as NumFrames says, found {len(table)}", file=path, row=3)
    if len(late := np.flatnonzero(~(np.diff(time) > 0.0))):
        raise table.error("expected time to increase", "Time", int(late[0]) + 1)
    axes = ([table.columns[f"{name}.{axis}"] for axis in "XYZ"] for name in names)
    return Markers(time, {name: METRES[unit] * np.stack(xyz, axis=1) for name, xyz in zip(names, axes, strict=True)})


def read_c3d(path: Path) -> Any:
    """A C3D file as ezc3d reads it.

    Raises
    ------
    InputError
        The file is missing or is none, or ezc3d is not installed.
    """
    ezc3d = optional_library("ezc3d", "c3d", ".c3d files need ezc3d", file=path)
    if not path.is_file():
        raise InputError("no such file", file=path)
    try:
        return ezc3d.c3d(str(path))
    except Exception as error:
        raise InputError(f"cannot be read as C3D: {str(error)[:80]}", file=path) from None


def _read_c3d(path: Path) -> Markers:
    """Points of a C3D file, in m; points that were not seen are NaN."""
    recording = read_c3d(path)
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
