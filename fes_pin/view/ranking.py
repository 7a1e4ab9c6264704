"""Figures of the causes: what each removes on held-out trials, and by how much its rivals fall short."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fes_pin.diagnosis.result import Diagnosis
from fes_pin.infer.levels import SEPARABLE
from fes_pin.infer.result import Cause
from fes_pin.models.catalogue import Catalogue
from fes_pin.view.chart import Panel, svg
from fes_pin.view.drawing import Drawing, rows_csv
from fes_pin.view.style import STAGES

RIVALS = 7
"""Rivals shown of each cause."""
LEAST = 0.3
"""Where the logarithmic axis of shortfalls begins."""
NAMES, WIDE, ROW = 176.0, 420.0, 24.0
"""Room for names, width of a figure, height of a row."""


def gain_drawing(diagnosis: Diagnosis) -> Drawing:
    """Gain of each cause: a bar, and its 95 % interval."""
    causes = diagnosis.causes
    on = "held-out" if any(c.gain_held_out.is_held_out for c in causes) else "fitted"
    low = min([0.0, *(c.gain_held_out.low for c in causes)])
    high = max([100.0, *(c.gain_held_out.high for c in causes)])
    panel = named_rows([c.name for c in causes], [c.stage for c in causes], (1.03 * low, 1.03 * high))
    rows: list[tuple[str | float, ...]] = []
    for k, cause in enumerate(causes):
        held, colour = cause.gain_held_out, _stage(cause.stage)
        panel.box((0.0, held.percent), (-k - 0.3, -k + 0.3), colour, 0.35)
        panel.line([held.low, held.high], [-k, -k], colour, 2.6)
        panel.dot(held.percent, -k, colour)
        rows.append((cause.name, held.percent, held.low, held.high))
    panel.x_axis(f"gain on {on} trials (%)")
    words = "; ".join(f"{n} {p:.0f} %, interval {a:.0f} to {b:.0f}" for n, p, a, b in rows)
    return rows_drawing(panel, len(causes), f"Gain of each cause on {on} trials: {words}.",
                    rows_csv(("cause", "gain_percent", "low", "high"), rows))  # fmt: skip


def rivals_drawing(diagnosis: Diagnosis, cause: Cause) -> Drawing:
    """The rivals of one cause by their shortfall, on a logarithmic axis.

    The shortfall is by how much twice the log-likelihood of the whole fit falls with the rival in the cause's place.
    The grey band is what chance alone makes; a hollow dot is a rival that is not told apart.
    """
    rivals = shown_rivals(diagnosis, cause)
    values = np.maximum([v for _, v in rivals], LEAST)
    stages = [_stage_of(diagnosis.catalogue, n) for n, _ in rivals]
    high = max(30.0, 2.5 * float(values.max()))
    panel = named_rows([n for n, _ in rivals], stages, (LEAST, high), True)
    panel.box((LEAST, SEPARABLE), panel.y, "band")
    for k, ((name, _), value, stage) in enumerate(zip(rivals, values, stages, strict=True)):
        panel.line([LEAST, value], [-k, -k], _stage(stage), 1.2, 0.6)
        panel.dot(float(value), -k, _stage(stage), hollow=name in cause.equivalents)
    powers = [10.0**p for p in range(int(np.ceil(np.log10(LEAST))), int(np.log10(high)) + 1)]
    shown = powers[:: max(1, -(-len(powers) // 5))]
    panel.x_axis("loss of twice the log-likelihood", [(p, f"{p:g}" if p < 1e4 else f"{p:.0e}".replace("e+0", "e"))
                                                       for p in shown])  # fmt: skip
    words = "; ".join(f"{n} {v:.3g}{', not told apart' if n in cause.equivalents else ''}" for n, v in rivals)
    return rows_drawing(
        panel,
        len(rivals),
        f"Rivals of {cause.name}, by how much twice the log-likelihood falls with each in its place: {words}. "
        f"Chance alone makes {SEPARABLE:.2g}.",
        rows_csv(("rival", "loss_of_twice_the_log_likelihood"), rivals),
    )


def shown_rivals(diagnosis: Diagnosis, cause: Cause) -> list[tuple[str, float]]:
    """Name and shortfall of the nearest rivals that would stand in the place of one cause."""
    others = {e.name for e in diagnosis.model.effects} - {cause.name}
    found: dict[str, float] = {}
    for one in diagnosis.ranking.get(cause.name, ()):
        instead = " + ".join(sorted(set(one.names) - others))
        if instead and instead != cause.name:
            found[instead] = min(one.shortfall, found.get(instead, np.inf))
    return sorted(found.items(), key=lambda pair: pair[1])[:RIVALS]


def named_rows(names: Sequence[str], stages: Sequence[str], x: tuple[float, float], logarithmic: bool = False) -> Panel:
    """A panel with a row for each name, in the colour of its stage."""
    panel = Panel(NAMES, 8, WIDE - NAMES - 14, ROW * len(names), x, (0.5 - len(names), 0.5), logarithmic)
    for k, (name, stage) in enumerate(zip(names, stages, strict=True)):
        panel.text(NAMES - 8, 8 + ROW * (k + 0.5) + 4, _cut(name), "end", _stage(stage), "name")
    return panel


def rows_drawing(panel: Panel, rows: int, words: str, csv: str) -> Drawing:
    """The figure of a panel of so many rows, described in words, with its data."""
    return Drawing(svg([panel], WIDE, 8 + ROW * rows + 40, words), csv)


def _stage(stage: str) -> str:
    return f"stage-{stage}" if stage in STAGES else "ink"


def _stage_of(catalogue: Catalogue, names: str) -> str:
    return str(catalogue.effect(names.split(" + ", maxsplit=1)[0]).stage)


def _cut(name: str, limit: int = 27) -> str:
    return name if len(name) <= limit else name[: limit - 1] + "\N{HORIZONTAL ELLIPSIS}"
