"""Charts of one row a name: estimates with their intervals, and rivals by how much worse they fit."""

import math
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fes_pin.infer.levels import SEPARABLE
from fes_pin.infer.result import Named
from fes_pin.view.drawing import Drawing, panels, rows_csv, svg
from fes_pin.view.style import COLOURS

LEAST = 0.3
"""Start of the logarithmic axis of losses."""
NAMES, ROW = 176.0, 24.0
"""Room for names, height of a row."""

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
        Values that the axis shows at least.
    """
    ends = [[end for end in row[2:4] if math.isfinite(end)] or [row[1]] for row in rows]
    drawing, panel = _rows([(row[0], row[4]) for row in rows])
    for k, (row, pair) in enumerate(zip(rows, ends, strict=True)):
        panel.plot([min(row[1], *pair), max(row[1], *pair)], [k, k], color=_colour(row[4]), linewidth=2.6)
        panel.plot(row[1], k, "o", color=_colour(row[4]))
    for value in x:
        panel.axvline(value, color=COLOURS["faint"], linewidth=0.8)
    panel.set_xmargin(0.05)
    panel.set_xlabel(axis)
    words = "; ".join(f"{n} {v:.4g}, interval {a:.4g} to {b:.4g}" for n, v, a, b, _ in rows)
    csv = rows_csv(("name", axis, "low", "high"), [(n.replace(",", " "), v, a, b) for n, v, a, b, _ in rows])
    return Drawing(svg(drawing, f"{axis}: {words}."), csv)


def rivals_drawing(cause: Named, rivals: Sequence[tuple[str, float, str]]) -> Drawing:
    """Rivals of a cause by the loss of twice the log-likelihood with each in its place, on a logarithmic axis.

    The grey band is what chance alone makes; a hollow dot is an equivalent rival.

    Parameters
    ----------
    rivals
        Name, loss and stage of each.
    """
    axis = "loss of twice the log-likelihood"
    drawing, panel = _rows([(n, stage) for n, _, stage in rivals])
    panel.axvspan(LEAST, SEPARABLE, color=COLOURS["band"])
    for k, (name, loss, stage) in enumerate(rivals):
        panel.plot([LEAST, max(loss, LEAST)], [k, k], color=_colour(stage), linewidth=1.2, alpha=0.6)
        fill = "none" if name in cause.equivalents else "full"
        panel.plot(max(loss, LEAST), k, "o", color=_colour(stage), fillstyle=fill)
    panel.set(xscale="log", xlim=(LEAST, max(30.0, 2.5 * max(v for _, v, _ in rivals))), xlabel=axis)
    words = "; ".join(f"{n} {v:.3g}{', equivalent' if n in cause.equivalents else ''}" for n, v, _ in rivals)
    about = f"Rivals of {cause.name}, {axis} with each in its place: {words}. Chance alone makes {SEPARABLE:.2g}."
    return Drawing(svg(drawing, about), rows_csv(("rival", axis.replace(" ", "_")), [r[:2] for r in rivals]))


def _rows(names: Sequence[tuple[str, str]]) -> tuple[Figure, Axes]:
    """A figure of one panel, with a row for each name in the colour of its stage."""
    drawing, ((panel,),) = panels([ROW * len(names)], left=NAMES)
    cut = [name if len(name) < 28 else name[:26] + "\N{HORIZONTAL ELLIPSIS}" for name, _ in names]
    panel.set_yticks(range(len(names)), cut)
    panel.set_ylim(len(names) - 0.5, -0.5)
    panel.tick_params(axis="y", length=0.0)
    for text, (_, stage) in zip(panel.get_yticklabels(), names, strict=True):
        text.set_color(_colour(stage))
    return drawing, panel


def _colour(stage: str) -> str:
    return next((COLOURS[name] for name in (f"stage-{stage}", stage) if name in COLOURS), COLOURS["ink"])
