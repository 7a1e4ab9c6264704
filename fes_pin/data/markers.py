"""Marker positions in .trc and C3D files as columns: `<marker>_x`, `_y`, `_z` in m, NaN where one was not seen."""

from pathlib import Path
from typing import Any

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.files import read_text
from fes_pin.data.recorded.form import TextForm
from fes_pin.data.recorded.text import table_of_lines

METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
"""What the units of a file are in metres."""
TIME = "time"
"""What the times of a format are called that has no column of them."""


def trc_points(path: Path) -> dict[str, np.ndarray]:
    """Times and points of a .trc file, by column.

    Three lines of header, marker names over every third column, X1 Y1 Z1 ..., then the numbers; tabs between.

    Raises
    ------
    InputError
        What the file holds is not what its format says, with row and column.
    """
    lines = read_text(path).split("\n")
    if len(lines) < 6 or not lines[0].startswith("PathFileType"):
        raise InputError("expected a .trc file that begins with PathFileType", file=path, row=1)
    header = dict(zip(lines[1].split(), lines[2].split(), strict=False))
    unit = header.get("Units", "").lower()
    if unit not in METRES:
        raise InputError(f"expected Units of m, cm or mm, found {unit[:20]!r}", file=path, row=3, column="Units")
    names = [n.strip() for n in lines[3].split("\t")[2:] if n.strip()]
    if not names:
        raise InputError("expected marker names after Frame# and Time", file=path, row=4)
    points = tuple(f"{name}_{axis}" for name in names for axis in "xyz")
    cells = 2 + len(points)  # what is behind them is no marker
    lines[5:] = ["\t".join(line.split("\t")[:cells]) for line in lines[5:]]
    table = table_of_lines(path, lines, ("Frame#", TIME, *points), TextForm("\t", header_row=4, first_row=6))
    if (stated := header.get("NumFrames")) not in (None, str(len(table))):
        raise InputError(f"expected {stated[:20]} frames as NumFrames says, found {len(table)}", file=path, row=3)
    if len(late := np.flatnonzero(~(np.diff(table.columns[TIME]) > 0.0))):
        raise table.error("expected time to increase", TIME, int(late[0]) + 1)
    return {TIME: table.columns[TIME], **{n: METRES[unit] * table.columns[n] for n in points}}


def c3d_points(recording: Any, path: Path) -> dict[str, np.ndarray]:
    """Times and points of a C3D file as ezc3d reads it, by column.

    Raises
    ------
    InputError
        The file does not name its points, or their unit.
    """
    point = recording["parameters"]["POINT"]
    labels = list(point["LABELS"]["value"])
    units = [str(u).lower() for u in point.get("UNITS", {}).get("value", [])]
    if not labels or not units or units[0] not in METRES:
        found = units[0][:20] if units else "nothing"
        raise InputError(f"expected points with UNITS of m, cm or mm, found {found!r}", file=path)
    data = METRES[units[0]] * np.asarray(recording["data"]["points"], dtype=float)[:3]
    time = np.arange(data.shape[2]) / float(recording["header"]["points"]["frame_rate"])
    return {TIME: time, **{f"{name}_{c}": data[j, k] for k, name in enumerate(labels) for j, c in enumerate("xyz")}}
