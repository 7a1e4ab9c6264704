"""Recordings in files that are no plain text: each by the library that its community keeps, as an extra.

| suffix | library | extra |
|---|---|---|
| `.parquet` | pyarrow | `parquet` |
| `.mat` | pymatreader (scipy and h5py) | `matlab` |
| `.c3d` | ezc3d | `c3d` |
| `.xdf`, `.xdfz` | pyxdf | `xdf` |
| `.xlsx`, `.xls`, `.ods` ... | python-calamine | `spreadsheet` |
| `.mot`, `.sto`, `.trc`, `.json`, `.jsonl` | none | |
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.files import as_path, read_bytes
from fes_pin.data.markers import TIME, c3d_points, trc_points
from fes_pin.data.motion import STORAGE, is_rotation, read_motion
from fes_pin.data.recorded.clock import since_first
from fes_pin.data.recorded.form import TextForm
from fes_pin.data.recorded.libraries import library, made, reading
from fes_pin.data.recorded.nested import NESTED, is_nested, nested_table
from fes_pin.data.recorded.text import read_text_recording, without_twins
from fes_pin.data.table import MIN_ROWS, Table

UNREADABLE = {
    ".numbers": "a spreadsheet of Numbers; save it as .xlsx or CSV",
    ".tdms": "a TDMS file of LabVIEW; save it as CSV, with LabVIEW or npTDMS",
    **dict.fromkeys((".npy", ".npz"), "a file of NumPy; save its arrays as columns of CSV or Parquet"),
    **dict.fromkeys((".h5", ".hdf5"), "an HDF5 file of no known layout; save its arrays as columns of CSV or Parquet"),
    **dict.fromkeys((".bag", ".db3", ".mcap"), "a log of ROS; save its topics as CSV"),
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
    if sheet and not is_nested(path):
        raise InputError("expected a spreadsheet, which has sheets", file=path, column="sheet")
    recording = nested_table(path, wanted, sheet) if is_nested(path) else _READERS[suffix](path, wanted)
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


def _parquet(path: Path, wanted: Sequence[str] | None) -> Table:
    parquet = library("pyarrow.parquet", "parquet", path)
    types = library("pyarrow.types", "parquet", path)
    with reading(path, "Parquet"):
        table = parquet.read_table(path)
    columns: dict[str, np.ndarray] = {}
    for name, column in zip(without_twins(list(table.column_names)), table.columns, strict=True):
        kind = column.type
        if types.is_timestamp(kind):  # seconds from the first one
            ticks = column.to_numpy().astype("datetime64[ns]").astype(np.int64)
            columns[name] = 1e-9 * (ticks - ticks[:1])
        elif types.is_integer(kind) or types.is_floating(kind) or types.is_boolean(kind):
            columns[name] = np.array(column.cast("float64").to_numpy(), dtype=float)
    return made(path, columns, wanted)


def _c3d(path: Path, wanted: Sequence[str] | None) -> Table:
    """Analog channels at their rate; where only points are wanted, `<marker>_x`, `_y`, `_z` in m at theirs."""
    ezc3d = library("ezc3d", "c3d", path)
    with reading(path, "C3D"):
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
    return replace(made(path, columns, wanted, units=stated), names=names)


def _trc(path: Path, wanted: Sequence[str] | None) -> Table:
    columns = trc_points(path)
    return made(path, columns, wanted, units=dict.fromkeys(columns, "m") | {TIME: "s"})


def _storage(path: Path, wanted: Sequence[str] | None) -> Table:
    table, in_degrees = read_motion(path)
    units = {} if in_degrees is None else {n: "deg" if in_degrees else "rad" for n in table.names if is_rotation(n)}
    return made(path, table.columns, wanted, units={**units, table.names[0]: "s"}, said=table.said)


def _xdf(path: Path, wanted: Sequence[str] | None) -> Table:
    """Streams of numbers, `<stream>.<channel>` where there are several; each has its own times."""
    pyxdf = library("pyxdf", "xdf", path)
    if read_bytes(path)[:4] not in (b"XDF:", b"\x1f\x8b\x08\x00", b"\x1f\x8b\x08\x08"):
        raise InputError("cannot be read as XDF: it does not begin as one", file=path)  # pyxdf would leave it open
    with reading(path, "XDF"):
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
    return made(path, columns, wanted, units=units)


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
    **{".parquet": _parquet, **dict.fromkeys(NESTED, nested_table), ".c3d": _c3d, ".trc": _trc},
    **{**dict.fromkeys(STORAGE, _storage), **dict.fromkeys((".xdf", ".xdfz"), _xdf)},
}
