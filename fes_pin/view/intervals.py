"""Charts of one row a name: estimates with their intervals, and rivals by how much worse they fit."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fes_pin.infer.levels import SEPARABLE
from fes_pin.infer.result import Named
from fes_pin.view.chart import Panel, svg
from fes_pin.view.drawing import Drawing, rows_csv
from fes_pin.view.style import COLOURS

LEAST = 0.3
"""Where the logarithmic axis of losses begins."""
NAMES, WIDE, ROW = 176.0, 420.0, 24.0
"""Room for names, width of a figure, height of a row."""

Row = tuple[str, float, float, float, str]
"""Name, value, ends of its 95 % interval, stage (or another name of a colour)."""


def intervals_drawing(rows: Sequence[Row], axis: str, x: tuple[float, ...] = ()) -> Drawing:
    """Values with their 95 % intervals, one below the other.

    Parameters
    ----------
    rows
        Ends that are not finite are not drawn.
    axis
        Title of the axis, with its unit.
    x
        Values that the axis holds at least.
    """
    ends = [[end for end in row[2:4] if math.isfinite(end)] or [row[1]] for row in rows]
    points = [*x, *(end for pair in ends for end in pair)]
    room = 0.05 * (max(points) - min(points)) or 1.0
    panel = _panel([(row[0], _colour(row[4])) for row in rows], (min(points) - room, max(points) + room))
    for k, (row, pair) in enumerate(zip(rows, ends, strict=True)):
        panel.line([min(row[1], *pair), max(row[1], *pair)], [-k, -k], _colour(row[4]), 2.6)
        panel.dot(row[1], -k, _colour(row[4]))
    panel.x_axis(axis)
    words = "; ".join(f"{n} {v:.4g}, interval {a:.4g} to {b:.4g}" for n, v, a, b, _ in rows)
    csv = rows_csv(("name", axis, "low", "high"), [(n.replace(",", " "), v, a, b) for n, v, a, b, _ in rows])
    return _drawing(panel, len(rows), f"{axis}: {words}.", csv)


def rivals_drawing(cause: Named, rivals: Sequence[tuple[str, float, str]]) -> Drawing:
    """Rivals of a cause by the loss of twice the log-likelihood with each in its place, on a logarithmic axis.

    The grey band is what chance alone makes; a hollow dot is an equivalent rival.

    Parameters
    ----------
    rivals
        Name, loss and stage of each.
    """
    values = np.maximum([v for _, v, _ in rivals], LEAST)
    high = max(30.0, 2.5 * float(values.max()))
    panel = _panel([(n, _colour(stage)) for n, _, stage in rivals], (LEAST, high), True)
    panel.box((LEAST, SEPARABLE), panel.y, "band")
    for k, ((name, _, stage), value) in enumerate(zip(rivals, values, strict=True)):
        panel.line([LEAST, value], [-k, -k], _colour(stage), 1.2, 0.6)
        panel.dot(float(value), -k, _colour(stage), hollow=name in cause.equivalents)
    powers = [10.0**p for p in range(int(np.ceil(np.log10(LEAST))), int(np.log10(high)) + 1)]
    shown = powers[:: max(1, -(-len(powers) // 5))]
    axis = "loss of twice the log-likelihood"
    panel.x_axis(axis, [(p, f"{p:g}" if p < 1e4 else f"{p:.0e}".replace("e+0", "e")) for p in shown])
    words = "; ".join(f"{n} {v:.3g}{', equivalent' if n in cause.equivalents else ''}" for n, v, _ in rivals)
    about = f"Rivals of {cause.name}, {axis} with each in its place: {words}. Chance alone makes {SEPARABLE:.2g}."
    return _drawing(panel, len(rivals), about, rows_csv(("rival", axis.replace(" ", "_")), [r[:2] for r in rivals]))


def _panel(names: Sequence[tuple[str, str]], x: tuple[float, float], logarithmic: bool = False) -> Panel:
    """A panel with a row for each name, in its colour."""
    panel = Panel(NAMES, 8, WIDE - NAMES - 14, ROW * len(names), x, (0.5 - len(names), 0.5), logarithmic)
    for k, (name, colour) in enumerate(names):
        cut = name if len(name) < 28 else name[:26] + "\N{HORIZONTAL ELLIPSIS}"
        panel.text(NAMES - 8, 8 + ROW * (k + 0.5) + 4, cut, "end", colour, "name")
    return panel


def _drawing(panel: Panel, rows: int, words: str, csv: str) -> Drawing:
    return Drawing(svg([panel], WIDE, 8 + ROW * rows + 40, words), csv)


def _colour(stage: str) -> str:
    return next((name for name in (f"stage-{stage}", stage) if name in COLOURS), "ink")
