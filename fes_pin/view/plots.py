"""Figures of a diagnosis: trials with their residuals, missing torque, inputs of a trial to come, estimates, rivals.

Each takes results and returns a `Drawing`. No text of the study stands in a figure but in its description. Charts of
one row a name show estimates with their intervals, and rivals by how much worse they fit.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from fes_pin.data.trial import Trial
from fes_pin.identify.replay import Replay
from fes_pin.infer.levels import SEPARABLE
from fes_pin.infer.result import Named
from fes_pin.infer.text import WHOLE, percent
from fes_pin.view.drawing import LEFT, RIGHT, TOP, WIDE, Drawing, panels, rows_csv, svg
from fes_pin.view.missing import Missing, binned, smoothed
from fes_pin.view.style import COLOURS, WIDTHS, label, quantity, short_unit

DOTS = 500
"""Dots of one panel."""
NARROW = 330.0
"""Width of a figure of the missing torque."""


Legend = Mapping[str, tuple[str, str]]
"""Name of a colour of `view.style`, and words, by name of a curve."""
MEASURED: Legend = {"measured": ("measured", "measured")}
MODELS: Legend = {
    **MEASURED,
    "nominal": ("nominal", "nominal model, fitted"),
    "extended": ("extended", "extended model"),
}
"""Legend of the trials of a diagnosis."""


def trial_drawing(one: Replay, legend: Legend = MODELS, position_unit: str = "rad") -> Drawing:
    """One trial: measured over simulated, the residual (measured - simulated) below, the stimulus as a strip.

    The residual's band is twice the standard deviation of the noise.

    Parameters
    ----------
    one
        The trial.
    legend
        Of "measured" and of each model.
    position_unit
        "rad" or "m".
    """
    time, inputs = one.measured.time, [n for n in one.measured.columns if n not in one.outputs]
    columns = {"time_s": time}
    drawing, axes = panels([*OVER_RESIDUAL] * len(one.outputs) + [28.0] * len(inputs))
    rows = iter(axes[:, 0])
    for name in one.outputs:
        curves = {"measured": one.measured[name], **{of: trial[name] for of, trial in one.models.items()}}
        columns |= {f"{name}_{of.replace(',', ' ')}": values for of, values in curves.items()}
        std = one.noise[name].std if name in one.noise else 0.0
        over_residual((next(rows), next(rows)), time, curves, legend, quantity(name, position_unit), std)
    for name in inputs:
        columns[name] = one.measured[name]
        _strip(next(rows), one.measured, name, position_unit)
    axes[-1, 0].set_xlabel("time (s)")
    of_group = f", {one.measured.group}" if one.measured.group else ""
    add_legend(drawing, {"measured": ("measured", f"measured{of_group}"), **{n: legend[n] for n in one.models}})
    return Drawing.of(svg(drawing, described(one, position_unit)), columns)


def described(one: Replay, position_unit: str) -> str:
    """A trial in words: what was measured, and by how much each model misses it."""
    trial, words = one.measured, []
    for name in one.outputs:
        what, unit = quantity(name, position_unit)
        missed = [f"{of} model at most {_short(np.abs(r).max())} {unit} off" for of, r in one.residuals(name).items()]
        low, high = _short(trial[name].min()), _short(trial[name].max())
        words.append(f"{what} from {low} to {high} {unit}; {', '.join(missed)}")
    return f"Trial {trial.name}, {trial.kind}, {trial.duration:.3g} s: {'. '.join(words)}. E {errors_in_words(one)}."


def errors_in_words(one: Replay) -> str:
    """Return the error E of each model."""
    return ", ".join(f"{of} {percent(e)}" for of, e in one.errors.items())


def _short(value: float) -> str:
    return f"{float(value):.3g}"


OVER_RESIDUAL = (130.0, 76.0)
"""Heights of a panel of curves, and of that of their residuals."""


def over_residual(
    pair: Iterable[Axes],
    time: np.ndarray,
    curves: Mapping[str, np.ndarray],
    legend: Legend,
    of: tuple[str, str],
    std: float = 0.0,
) -> None:
    """Draw what was measured in front of models, and residuals (measured - model) below, as they are and smoothed.

    Parameters
    ----------
    pair
        The panel of the curves, and that of the residuals.
    time
        Shape (n,), s.
    curves
        "measured" and each model, shape (n,), by their names in the legend.
    of
        Name of the quantity, and its unit.
    std
        Standard deviation of the noise, in that unit; 0 where it is not known.
    """
    upper, lower = pair
    colour = {n: legend[n][0] for n in curves}
    what, unit = of
    scale, long_unit = min((1.0, unit), short_unit(curves["measured"], unit))
    for n in sorted(curves, key=lambda n: -WIDTHS.get(colour[n], WIDTHS["nominal"])):  # what was measured is thinnest
        width = WIDTHS.get(colour[n], WIDTHS["nominal"])
        upper.plot(time, scale * curves[n], color=COLOURS[colour[n]], linewidth=width)
    upper.set_ylabel(f"{what} ({long_unit})" if unit else what)
    residuals = {n: curves["measured"] - values for n, values in curves.items() if n != "measured"}
    largest = max(residuals.values(), key=lambda r: float(np.abs(r).max()))
    factor, small = short_unit(largest, unit)
    lower.axhspan(-2.0 * factor * std, 2.0 * factor * std, color=COLOURS["band"])
    lower.axhline(color=COLOURS["faint"], linewidth=0.8)
    for n, residual in residuals.items():
        lower.plot(time, factor * residual, color=COLOURS[colour[n]], linewidth=0.6, alpha=0.45)
    for n, residual in residuals.items():
        lower.plot(*smoothed(time, factor * residual), color=COLOURS[colour[n]], linewidth=1.9)
    limit = 1.1 * factor * float(np.abs(largest).max()) or 1.0
    lower.set(ylim=(-limit, limit), ylabel=f"residual\n({small})" if small else "residual")


LONGEST = 28
"""Letters of a name in a figure; of a longer one the end is left out."""


def add_legend(drawing: Figure, entries: Legend, left: float = LEFT) -> None:
    """Write a legend above the panels of a figure."""
    known = [(COLOURS[colour], WIDTHS.get(colour, WIDTHS["nominal"]), words) for colour, words in entries.values()]
    lines = [Line2D([], [], color=colour, linewidth=width, label=_cut(words)) for colour, width, words in known]
    written = drawing.legend(
        handles=lines,
        loc="upper left",
        bbox_to_anchor=(left / 72.0 / drawing.get_figwidth(), 1.0),
        ncols=len(lines),
        frameon=False,
        labelcolor=COLOURS["ink"],
        fontsize=10,
        borderaxespad=0.0,
        handlelength=1.4,
        columnspacing=1.4,
    )
    for text in written.get_texts():
        text.set_parse_math(False)  # a group may be called $a_b$


def _cut(name: str) -> str:
    return name if len(name) < LONGEST else name[: LONGEST - 2] + "\N{HORIZONTAL ELLIPSIS}"


def _strip(panel: Axes, trial: Trial, name: str, position_unit: str) -> None:
    """The stimulus, thin, with its name above."""
    panel.plot(trial.time, trial[name], color=COLOURS["stimulus"], drawstyle="steps-post", linewidth=0.7)
    panel.locator_params(axis="y", nbins=2)
    title = label(name, position_unit)
    panel.set_title(title, loc="left", pad=2.0, fontsize=9, color=COLOURS["ink"], parse_math=False)


def missing_drawing(
    before: Sequence[Missing], after: Sequence[Missing], name: str, position_unit: str = "rad"
) -> Drawing:
    """Missing torque (or force) against one variable.

    Dots are instants of all trials; the lines join the medians of bins of equal width. The percentage says how much of
    the variance is a function of that variable alone.

    Parameters
    ----------
    before
        Of the nominal model, trial by trial, all of one kind.
    after
        Of the extended model; empty where it is the nominal one.
    name
        Of the variable.
    position_unit
        As in `trial_drawing`.
    """
    value, x = _joined(before, name)
    factor, unit = short_unit(value, before[0].unit)
    drawing, axes = panels([150.0], NARROW, 58.0)
    panel = axes[0, 0]
    panel.set_xmargin(0.03)
    panel.axhline(color=COLOURS["faint"], linewidth=0.8)
    chosen = instants(x, value)
    panel.plot(x[chosen], factor * value[chosen], ".", color=COLOURS["nominal"], markersize=2.4)
    at, middle, share_of = binned(value, x)
    panel.plot(at, factor * middle, color=COLOURS["measured"], linewidth=1.8)
    rows: list[tuple[str | float, ...]] = [("instant", a, b) for a, b in zip(x[chosen], value[chosen], strict=True)]
    rows += [("median_nominal", a, b) for a, b in zip(at, middle, strict=True)]
    left = ""
    if after:
        there, stays, _ = binned(*_joined(after, name))
        panel.plot(there, factor * stays, color=COLOURS["extended"], linewidth=2.8)
        rows += [("median_extended", a, b) for a, b in zip(there, stays, strict=True)]
        left = f"; of the extended model from {_short(stays.min())} to {_short(stays.max())} {before[0].unit}"
    limit = factor * max(1.15 * float(np.quantile(np.abs(value), 0.995)), 1e-12)  # all but the few largest values
    panel.set(ylim=(-limit, limit), xlabel=label(name, position_unit), ylabel=f"missing {before[0].kind} ({unit})")
    panel.set_title(f"{100 * share_of:.0f} % of its variance", loc="right", color=COLOURS["ink"], fontsize=10)
    words = (
        f"Missing {before[0].kind} against {label(name, position_unit)}: its median in bins runs from "
        f"{_short(middle.min())} to {_short(middle.max())} {before[0].unit}{left}. "
        f"{100 * share_of:.0f} % of its variance is a function of this alone."
    )
    head = ("what", label(name, position_unit).replace(",", ""), f"missing {before[0].kind} ({before[0].unit})")
    return Drawing(svg(drawing, words), rows_csv(head, rows))


def share(before: Sequence[Missing], name: str) -> float:
    """Share of the missing input's variance that is a function of one variable alone, 0 to 1."""
    return binned(*_joined(before, name))[2]


def _joined(many: Sequence[Missing], name: str) -> tuple[np.ndarray, np.ndarray]:
    return np.concatenate([m.value for m in many]), np.concatenate([m.against[name] for m in many])


def instants(x: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Instants at about equal distances along the curve in a panel: rest is drawn once, motion in full."""
    across, up = (np.abs(np.diff(one)) / max(float(np.ptp(one)), 1e-300) for one in (x, value))
    steps = across + up
    along = np.concatenate([[0.0], np.cumsum(steps + 0.3 * steps.mean() + 1e-12)])
    return np.unique(np.searchsorted(along, np.linspace(0.0, along[-1], min(DOTS, len(x)))))


def stimulus_drawing(trial: Trial, position_unit: str = "rad") -> Drawing:
    """The inputs of a trial that is still to be run."""
    drawing, axes = panels([28.0] * len(trial.columns))
    for panel, name in zip(axes[:, 0], trial.columns, strict=True):
        _strip(panel, trial, name, position_unit)
    axes[-1, 0].set_xlabel("time (s)")
    ranges = ", ".join(
        f"{label(n, position_unit)} from {_short(v.min())} to {_short(v.max())}" for n, v in trial.columns.items()
    )
    words = f"Inputs of the next trial, {trial.duration:.3g} s: {ranges}."
    return Drawing.of(svg(drawing, words), {"time_s": trial.time, **trial.columns})


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


HeatCell = float | Literal["equivalent", "not testable"]
"""A cell of a heat map: a share in percent (NaN where it is not known), or why there is none."""
SIGNS = {"equivalent": "=", "not testable": "x"}
COLUMN, PALEST = 46.0, 0.25
"""Width of a column of a heat map, and the opacity of a share of zero."""


def heat_drawing(rows: Sequence[str], columns: Sequence[str], cells: Mapping[tuple[str, str], HeatCell]) -> Drawing:
    """Draw a heat map: cells by row and column, darker for a larger share, with the share or a sign in each.

    Parameters
    ----------
    cells
        By row and column; an absent cell stays empty.
    """
    above, width = 5.0 * max(map(len, columns)) + TOP, NAMES + COLUMN * len(columns) + RIGHT
    drawing, panel = _rows([(name, "ink") for name in rows], width + above, above)
    panel.set_xlim(0.0, (width + above - NAMES - RIGHT) / COLUMN)
    panel.set_xticks(np.arange(len(columns)) + 0.5, columns, rotation=40, ha="left", rotation_mode="anchor")
    panel.tick_params(axis="x", top=False, bottom=False, labeltop=True, labelbottom=False)
    panel.spines[:].set_visible(False)
    at = {name: k for k, name in enumerate(columns)}
    for k, name in enumerate(rows):
        for other, cell in ((c, cells[name, c]) for c in columns if (name, c) in cells):
            place = at[other] + 0.03, k - 0.46
            panel.add_patch(Rectangle(place, 0.94, 0.92, color=COLOURS["band"]))
            sign = SIGNS[cell] if isinstance(cell, str) else "named" if math.isnan(cell) else f"{cell:.0f} %"
            if not isinstance(cell, str):
                share = 0.0 if math.isnan(cell) else min(max(cell, 0.0), WHOLE) / WHOLE
                panel.add_patch(
                    Rectangle(place, 0.94, 0.92, color=COLOURS["extended"], alpha=PALEST + (1.0 - PALEST) * share)
                )
            panel.text(at[other] + 0.5, k, sign, ha="center", va="center", fontsize=9, color=COLOURS["measured"])
    known = [(n, c, value if isinstance(value, str) else f"{value:.4g}") for (n, c), value in cells.items() if c in at]
    words = "; ".join(f"{n}: {c} {value}" for n, c, value in known)
    return Drawing(
        svg(drawing, f"Studies by causes, percent: {words}."), rows_csv(("study", "cause", "percent"), known)
    )


def _rows(names: Sequence[tuple[str, str]], width: float = WIDE, top: float = TOP) -> tuple[Figure, Axes]:
    """A figure of one panel, with a row for each name in the colour of its stage."""
    drawing, ((panel,),) = panels([ROW * len(names)], width, NAMES, top=top)
    panel.set_yticks(range(len(names)), [_cut(name) for name, _ in names], parse_math=False)
    panel.set_ylim(len(names) - 0.5, -0.5)
    panel.tick_params(axis="y", length=0.0)
    for text, (_, stage) in zip(panel.get_yticklabels(), names, strict=True):
        text.set_color(_colour(stage))
    return drawing, panel


def _colour(stage: str) -> str:
    return next((COLOURS[name] for name in (f"stage-{stage}", stage) if name in COLOURS), COLOURS["ink"])
