"""Figures of the causes: what each removes on held-out trials, and by how much its rivals fall short."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fes_pin.diagnose.diagnosis import SEPARABLE, Cause, Diagnosis, Ranked
from fes_pin.models.effects import effect
from fes_pin.view.style import BAND, FAINT, INK, STAGES, WIDTH, styled

RIVALS = 7
"""Rivals shown of each cause."""
LEAST = 0.3
"""Where the logarithmic axis of shortfalls begins."""


def ranking_figure(diagnosis: Diagnosis) -> Figure:
    """Held-out gain of each cause with its interval; beneath, the rivals of each by their shortfall.

    The shortfall is by how much twice the log-likelihood of the whole fit falls with the rival in the cause's place.
    Rivals in the grey band are not told apart from it at 95 %.
    """
    causes = diagnosis.causes
    rivals = {c.name: shown_rivals(diagnosis.ranking.get(c.name, ()), diagnosis, c) for c in causes}
    counts = [len(causes), *(len(rivals[c.name]) for c in causes if rivals[c.name])]
    heights = [0.3 * n + 0.12 for n in counts]
    with styled():
        figure = Figure(figsize=(WIDTH, sum(heights) + 0.95 * len(heights) + 0.1))
        total = figure.get_figheight()
        top = total - 0.3
        places = []
        for height in heights:
            places.append((0.37, (top - height) / total, 0.59, height / total))
            top -= height + 0.95
        axes = figure.add_axes(places[0])
        _gains(axes, causes)
        for cause, place in zip([c for c in causes if rivals[c.name]], places[1:], strict=True):
            _shortfalls(figure.add_axes(place), cause, rivals[cause.name])
    return figure


def shown_rivals(ranked: Sequence[Ranked], diagnosis: Diagnosis, cause: Cause) -> list[tuple[str, float]]:
    """Name and shortfall of the nearest rivals that would stand in the place of one cause."""
    others = {e.name for e in diagnosis.model.effects} - {cause.name}
    found: dict[str, float] = {}
    for one in ranked:
        instead = " + ".join(sorted(set(one.names) - others))
        if instead and instead != cause.name:
            found[instead] = min(one.shortfall, found.get(instead, np.inf))
    return sorted(found.items(), key=lambda pair: pair[1])[:RIVALS]


def _gains(axes: Axes, causes: Sequence[Cause]) -> None:
    for k, cause in enumerate(causes):
        held = cause.gain_held_out
        colour = STAGES.get(cause.stage, INK)
        axes.barh(k, held.percent, 0.62, color=colour, alpha=0.35, lw=0)
        axes.plot([held.low, held.high], [k, k], color=colour, lw=2.6)
        axes.plot([held.percent], [k], "o", color=colour, ms=5)
    _rows(axes, [c.name for c in causes], [STAGES.get(c.stage, INK) for c in causes])
    low = min([0.0, *(c.gain_held_out.low for c in causes)])
    high = max([100.0, *(c.gain_held_out.high for c in causes)])
    axes.set(xlim=(1.03 * low, 1.03 * high), xlabel="held-out gain (% of the error above noise)")
    axes.axvline(0.0, color=FAINT, lw=0.7)


def _shortfalls(axes: Axes, cause: Cause, rivals: Sequence[tuple[str, float]]) -> None:
    values = np.maximum([v for _, v in rivals], LEAST)
    names = [n for n, _ in rivals]
    colours = [_colour(n) for n in names]
    axes.set_xscale("log")
    axes.axvspan(LEAST, SEPARABLE, color=BAND, lw=0)
    for k, (value, colour) in enumerate(zip(values, colours, strict=True)):
        near = names[k] in cause.equivalents
        axes.plot([LEAST, value], [k, k], color=colour, lw=1.2, alpha=0.6)
        axes.plot([value], [k], "o", color=colour, ms=6, mfc="none" if near else colour, mew=1.6)
    _rows(axes, names, colours)
    axes.set(xlim=(LEAST, max(30.0, 2.5 * float(values.max()))), xlabel="shortfall in 2 log-likelihood (1)")
    axes.set_title(f"in place of {cause.name}", fontsize=10.5, loc="left", pad=4)


def _colour(names: str) -> str:
    return STAGES.get(str(effect(names.split(" + ", maxsplit=1)[0]).stage), INK)


def _rows(axes: Axes, names: Sequence[str], colours: Sequence[str]) -> None:
    axes.set_yticks(range(len(names)), [_cut(n) for n in names])
    for text, colour in zip(axes.get_yticklabels(), colours, strict=True):
        text.set_color(colour)
    axes.set_ylim(len(names) - 0.45, -0.55)
    axes.tick_params(axis="y", length=0)


def _cut(name: str, limit: int = 24) -> str:
    return name if len(name) <= limit else name[: limit - 1] + "\N{HORIZONTAL ELLIPSIS}"
