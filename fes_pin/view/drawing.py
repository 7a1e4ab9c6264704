"""A figure of a report: its drawing, its words for those who cannot see it, and its data as CSV behind it.

matplotlib draws it, as SVG text whose colours are those of the page around it.
"""

from __future__ import annotations

import html
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import style
from matplotlib.figure import Figure

from fes_pin.view.style import COLOURS

WIDE, LEFT, RIGHT, TOP, BOTTOM, GAP = 420.0, 66.0, 8.0, 20.0, 38.0, 14.0
"""Width of a figure, room about its panels and between them; points."""
INK = COLOURS["ink"]
LOOK = {
    **{"svg.fonttype": "none", "svg.hashsalt": "fes_pin", "font.size": 10, "axes.labelsize": 11, "axes.linewidth": 0.8},
    **{"axes.edgecolor": INK, "axes.labelcolor": INK, "xtick.color": INK, "ytick.color": INK, "text.color": INK},
    **{"axes.spines.top": False, "axes.spines.right": False, "axes.facecolor": "none", "figure.facecolor": "none"},
    **{"axes.xmargin": 0.0, "path.simplify_threshold": 0.7},
}
"""matplotlib's settings: texts stay texts, in the page's own type; two figures of the same data are alike; a long curve
is drawn with as many points as show on the page, and every extreme stays."""
SHORTER = {
    r"\s*\n\s*": " ",
    r' id="[\w.]+_\d+"': "",
    r"(\.\d\d)\d+(?![^<>]{0,60}</text>)": r"\1",
    r"font(?:-size)?: ([\d.]+px)[^;]*;(?: font-family: [^;]*;)?": r"font-size: \1;",
}
"""Parts of matplotlib's text that are omitted: names that other figures have as well, digits of places, and type."""
NO_METADATA = dict.fromkeys(("Creator", "Date", "Format", "Type"))


def panels(
    heights: Sequence[float], width: float = WIDE, left: float = LEFT, columns: int = 1, top: float = TOP
) -> tuple[Figure, np.ndarray]:
    """A figure of panels with one horizontal axis, and the panels, shape (rows, columns).

    Parameters
    ----------
    heights
        Of each row of panels, points.
    width, left
        Widths of a column and of the margin to the left of its panels; points.
    columns
        How many there are.
    top
        Height above the panels, points.
    """
    tall, inner = top + sum(heights) + GAP * (len(heights) - 1) + BOTTOM, width - left - RIGHT
    place = {"left": left / width / columns, "right": 1.0 - RIGHT / width / columns}
    place |= {"top": 1.0 - top / tall, "bottom": BOTTOM / tall}
    place |= {"hspace": GAP / float(np.mean(heights)), "wspace": (left + RIGHT) / inner}
    with style.context(LOOK):
        figure = Figure((columns * width / 72.0, tall / 72.0))
        axes = figure.subplots(
            len(heights), columns, sharex=True, squeeze=False, height_ratios=heights, gridspec_kw=place
        )
    return figure, axes


def svg(figure: Figure, description: str) -> str:
    """A figure as an `<svg>` element, which fills its place in a page; `description` is for those who cannot see it."""
    stream = io.StringIO()
    with style.context(LOOK):
        figure.align_ylabels()
        figure.savefig(stream, format="svg", metadata=NO_METADATA)
    drawn = stream.getvalue().partition("</defs>")[2]  # behind a style sheet that would be that of the whole page
    for pattern, instead in SHORTER.items():
        drawn = re.sub(pattern, instead, drawn)
    for name, value in COLOURS.items():
        drawn = drawn.replace(value, f"var(--{name}, {value})")
    size = " ".join(f"{72.0 * side:g}" for side in figure.get_size_inches())
    return (
        f'<svg class="chart" viewBox="0 0 {size}" role="img" aria-label="{html.escape(description, quote=True)}" '
        f'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink">{drawn}'
    )


ROWS = 800
"""Rows of the data behind a figure, at most; of a longer trial every second, third ... sample stands there."""


@dataclass(frozen=True)
class Drawing:
    """The parts of a figure that a page needs.

    Attributes
    ----------
    svg
        The element, with its description inside.
    csv
        The data that it shows.
    note
        What the data leave out; empty for nothing.
    """

    svg: str
    csv: str
    note: str = ""

    @classmethod
    def of(cls, svg: str, columns: Mapping[str, np.ndarray], rows: int = ROWS) -> Drawing:
        """Return a drawing whose data are columns of numbers, thinned to about so many rows."""
        step = max(1, -(-len(next(iter(columns.values()))) // rows))
        arrays = [np.asarray(v, dtype=float)[::step].tolist() for v in columns.values()]
        csv = rows_csv(tuple(columns), list(zip(*arrays, strict=True)))
        return cls(svg, csv, f"one sample in {step}" if step > 1 else "")


def rows_csv(head: Sequence[str], rows: Sequence[Sequence[str | float]]) -> str:
    """Rows of words and numbers as CSV; the words hold no comma."""
    lines = [",".join(head)]
    lines += [",".join(v if isinstance(v, str) else f"{v:.6g}" for v in row) for row in rows]
    return "\n".join(lines) + "\n"
