"""Recordings as text, right and odd: times, numbers, names, separators, line ends and encodings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

Rng = np.random.Generator
T = TypeVar("T")
Drawn = Callable[[Sequence[Any]], Any]
Cells = list[list[str]]
ROWS = (60, 25, 0, 1, 2, 3, 4, 8, 150)
NAMES = (
    *(
        "Angle",
        "Angle [deg]",
        "angle_rad",
        "Torque (Nm)",
        "Torque",
        "force_n",
        "Velocity [deg/s]",
        "Current [A]",
        "emg",
    ),
    *(
        "position",
        "effort",
        "pulse_width_us",
        "stim",
        "Sync",
        "Pos",
        "Pos cmd",
        "Winkel (°)",
        "Drehmoment",
        "x",
        "",
        " ",
    ),
    *("Angle", "角度", "a,b", 'a"b', "a;b", "nan", "1", "time_s", "Time", "velocity", "F1", "counts", "_", "q" * 3000),
)
EFFORTS = ("Torque (Nm)", "Torque", *NAMES)
TIME_NAMES = ("time_s", "Time (s)", "t", "Time [ms]", "t_us", "time", "Timestamp", "Zeit", "", "x", "Date")
UNITS = ("", "-", "s", "ms", "deg", "Nm", "N", "rad", "V", "mN m", "°", "µs", "furlong", "[deg]", "(Nm)", "counts", "3")
ENCODINGS = ("utf-8", "utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1252", "latin-1", "utf-7")
SEPARATORS = (",", ";", "\t", " ", "  ", "|", ", ")
ENDS = ("\n", "\r\n", "\r", "\n\n", "\x0b", "\u2028")
ODD_CELLS = (
    "",
    "nan",
    "NaN",
    "inf",
    "-inf",
    "1e400",
    "1e308",
    "-",
    "N/A",
    "x",
    "1.2.3",
    "0x1F",
    "1e-320",
    "--",
    "#DIV/0!",
    "9" * 400,
)
PREAMBLES = (
    "made by hand",
    "# rate: 100 Hz",
    "Sample rate,100",
    "Interval=\t0.01 s",
    "Device: X; v1",
    "",
    "1,2,3",
    "%",
    "'",
)


def recording(rng: Rng) -> tuple[bytes, list[str]]:
    """A recording, and the names of its columns, of which the first holds the times."""
    odd = float(rng.choice((0.1, 0.3, 1.0)))  # a recording in which all is odd shows only what is read first

    def drawn(choices: Sequence[T]) -> T:
        """One of what may be, of which the first are usual."""
        return choices[int(rng.integers(len(choices))) if rng.uniform() < odd else int(rng.integers(2))]

    count = drawn(ROWS)
    times = _times(rng, drawn, count)
    columns = [_column(rng, drawn, count) for _ in range(int(rng.integers(1, 4)) if rng.uniform() < 0.99 else 300)]
    names = [drawn(TIME_NAMES), *(drawn(NAMES if k == 0 else EFFORTS) for k in range(len(columns)))]
    cells = [list(row) for row in zip(times, *columns, strict=True)]
    for _ in range(int(rng.integers(4)) if count and rng.uniform() < odd else 0):
        row = cells[int(rng.integers(count))]
        row[int(rng.integers(len(row)))] = str(rng.choice(ODD_CELLS))
    return _written(rng, drawn, odd, names, cells), names


def one_of(rng: Rng, choices: tuple[str, ...]) -> str:
    """One of some words; numpy's own choice would lose zeros at their ends."""
    return choices[int(rng.integers(len(choices)))]


def _times(rng: Rng, drawn: Drawn, count: int) -> list[str]:
    steps = np.arange(count)
    step = drawn((0.01, 0.01, 10.0, 1e4, 0.001, 1 / 60))
    make: tuple[Callable[[], np.ndarray], ...] = (
        *(lambda: step * steps,) * 2,
        lambda: step * steps[::-1],
        lambda: np.full(count, 3.0),
        lambda: step * np.repeat(steps, 2)[:count],
        lambda: step * (steps % max(1, count // 2)),
        lambda: step * np.cumsum(1.0 + 20.0 * (rng.uniform(size=count) < 0.05)),
        lambda: step * np.cumsum(rng.uniform(0.5, 1.5, count)),
        lambda: 1.6e9 + step * steps,
        lambda: 1e300 * steps,
        lambda: rng.permutation(steps) * step,
        lambda: -step * 30 + step * steps,
    )
    values = drawn(make)()
    kind = drawn((3, 3, 0, 1, 2))
    if kind == 0:
        return [f"2024-03-{1 + k // 30:02d}T12:{k % 60:02d}:{k % 60:02d}.{k % 10}00" for k in range(count)]
    if kind == 1:
        return [f"{int(v) // 3600 % 30}:{int(v) // 60 % 60:02d}:{v % 60:06.3f}" for v in values]
    return [f"{v:.{'6g' if kind == 2 else '9g'}}" for v in values]


def _column(rng: Rng, drawn: Drawn, count: int) -> list[str]:
    phase = np.arange(count) / float(rng.uniform(2.0, 20.0))
    values = 10.0 ** drawn((0, 1, 2, -3, 6, 30, 300, -300)) * np.sin(phase + rng.uniform(0, 6))
    kind = drawn((9, 9, 0, 1, 2, 3, 4, 5))
    if kind == 0:
        values = np.full(count, float(rng.choice((0.0, 1.0, -3.5))))
    elif kind == 1:
        values = (np.arange(count) % 5 == 0).astype(float)
    elif kind == 2:
        values = 300.0 * (phase % 1.0)
    elif kind == 3:
        values = np.where(rng.uniform(size=count) < 0.2, np.nan, values)
    elif kind == 4:
        values = np.round(values)
    elif kind == 5:
        return [str(rng.choice(("on", "off"))) for _ in range(count)]
    return [f"{v:.{drawn((5, 6, 2))}g}" for v in values]


def _written(rng: Rng, drawn: Drawn, odd: float, names: list[str], cells: Cells) -> bytes:
    between = drawn(SEPARATORS)
    if rng.uniform() < 0.15 * odd:
        cells = [[cell.replace(".", ",") for cell in row] for row in cells]
    rows = [*_header(drawn, names), *cells]
    if rng.uniform() < 0.05 * odd:
        rows = [list(row) for row in zip(*rows, strict=False)]
    quote = '"' if rng.uniform() < 0.15 * odd else ""
    lines = [between.join(f"{quote}{cell}{quote}" for cell in row) for row in rows]
    lines = [drawn(PREAMBLES)] * drawn((0, 0, 1, 2, 400)) + lines
    if rng.uniform() < 0.1 * odd:
        lines = [line + between for line in lines]
    if rng.uniform() < 0.05 * odd:
        lines = [f"[{line}]" for line in lines[:1]] + lines[1:]
    end = drawn(ENDS)
    mixed = rng.uniform() < 0.1
    ends = [one_of(rng, ENDS) if mixed else end for _ in lines]
    text = "".join(a + b for a, b in zip(lines, ends, strict=True))
    text = text.rstrip() if rng.uniform() < 0.2 * odd else text
    return text.encode(drawn(ENCODINGS), errors="replace")


def _header(drawn: Drawn, names: list[str]) -> Cells:
    units = [drawn(UNITS) for _ in names]
    kinds: tuple[Cells, ...] = (
        [names],
        [names, units],
        [units, names],
        [],
        [names[:-1]],
        [[*names, "more"]],
        [names, [""] * len(names)],
        [[f"# {names[0]}", *names[1:]]],
        [names, names],
        [["", *names[1:]]],
    )
    return drawn(kinds)
