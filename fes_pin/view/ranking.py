"""Figures of the causes: what each removes on held-out trials, and by how much its rivals fall short."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fes_pin.diagnose.cause import Cause
from fes_pin.diagnose.experiment import SEPARABLE
from fes_pin.diagnose.result import Diagnosis
from fes_pin.models.catalogue import Catalogue
from fes_pin.view.style import BAND, FAINT, INK, PANEL, STAGES, styled

RIVALS = 7
"""Rivals shown of each cause."""
LEAST = 0.3
"""Where the logarithmic axis of shortfalls begins."""


def gain_figure(causes: Sequence[Cause]) -> Figure:
    """Held-out gain of each cause: a bar, and its 95 % interval."""
    figure, axes = _rows_figure(len(causes))
    with styled():
        for k, cause in enumerate(causes):
            held, colour = cause.gain_held_out, STAGES.get(cause.stage, INK)
            axes.barh(k, held.percent, 0.62, color=colour, alpha=0.35, lw=0)
            axes.plot([held.low, held.high], [k, k], color=colour, lw=2.6)
            axes.plot([held.percent], [k], "o", color=colour, ms=5)
        _rows(axes, [c.name for c in causes], [STAGES.get(c.stage, INK) for c in causes])
        low = min([0.0, *(c.gain_held_out.low for c in causes)])
        high = max([100.0, *(c.gain_held_out.high for c in causes)])
        axes.set(xlim=(1.03 * low, 1.03 * high), xlabel="held-out gain (%)")
        axes.axvline(0.0, color=FAINT, lw=0.7)
    return figure


def rivals_figure(diagnosis: Diagnosis, cause: Cause) -> Figure:
    """The rivals of one cause by their shortfall, on a logarithmic axis.

    The shortfall is by how much twice the log-likelihood of the whole fit falls with the rival in the cause's place.
    The grey band is what chance alone makes; a hollow dot is a rival that is not told apart.
    """
    rivals = shown_rivals(diagnosis, cause)
    figure, axes = _rows_figure(len(rivals))
    with styled():
        values = np.maximum([v for _, v in rivals], LEAST)
        names = [n for n, _ in rivals]
        colours = [_colour(diagnosis.catalogue, n) for n in names]
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(lambda x, _: f"{x:g}" if x < 2e3 else f"{x:.0e}".replace("e+0", "e"))
        axes.minorticks_off()
        axes.axvspan(LEAST, SEPARABLE, color=BAND, lw=0)
        for k, (value, colour) in enumerate(zip(values, colours, strict=True)):
            near = names[k] in cause.equivalents
            axes.plot([LEAST, value], [k, k], color=colour, lw=1.2, alpha=0.6)
            axes.plot([value], [k], "o", color=colour, ms=6, mfc="none" if near else colour, mew=1.6)
        _rows(axes, names, colours)
        axes.set(xlim=(LEAST, max(30.0, 2.5 * float(values.max()))), xlabel="shortfall, 2 log-lik. (1)")
    return figure


def _rows_figure(count: int) -> tuple[Figure, Axes]:
    """A figure with room for rows of horizontal bars."""
    with styled():
        height = 0.3 * count + 0.12
        figure = Figure(figsize=(PANEL, height + 0.65))
        total = figure.get_figheight()
        return figure, figure.add_axes((0.45, 0.58 / total, 0.52, height / total))


def shown_rivals(diagnosis: Diagnosis, cause: Cause) -> list[tuple[str, float]]:
    """Name and shortfall of the nearest rivals that would stand in the place of one cause."""
    others = {e.name for e in diagnosis.model.effects} - {cause.name}
    found: dict[str, float] = {}
    for one in diagnosis.ranking.get(cause.name, ()):
        instead = " + ".join(sorted(set(one.names) - others))
        if instead and instead != cause.name:
            found[instead] = min(one.shortfall, found.get(instead, np.inf))
    return sorted(found.items(), key=lambda pair: pair[1])[:RIVALS]


def _colour(catalogue: Catalogue, names: str) -> str:
    return STAGES.get(str(catalogue.effect(names.split(" + ", maxsplit=1)[0]).stage), INK)


def _rows(axes: Axes, names: Sequence[str], colours: Sequence[str]) -> None:
    axes.set_yticks(range(len(names)), [_cut(n) for n in names])
    for text, colour in zip(axes.get_yticklabels(), colours, strict=True):
        text.set_color(colour)
    axes.set_ylim(len(names) - 0.45, -0.55)
    axes.tick_params(axis="y", length=0)


def _cut(name: str, limit: int = 24) -> str:
    return name if len(name) <= limit else name[: limit - 1] + "\N{HORIZONTAL ELLIPSIS}"
