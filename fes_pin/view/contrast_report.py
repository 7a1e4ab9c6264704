"""The report of a contrast: one page that holds everything it shows."""

from __future__ import annotations

import math
from collections.abc import Mapping

from fes_pin.contrasts.result import Contrast
from fes_pin.infer.result import Change, ParameterEstimate
from fes_pin.infer.text import probability
from fes_pin.view.drawing import Drawing, rows_csv
from fes_pin.view.page import Content, Markup, element, figure, html_table, page, section, unit_text
from fes_pin.view.ranking import named_rows, rows_drawing
from fes_pin.view.report_causes import card, told_apart, value_and_interval

SAID = ("in all groups", "repeats scatter", "something is left", "nothing left")
"""Beginnings of the notes that stand beside how it was judged; the others have sections of their own."""


def contrast_html(found: Contrast) -> str:
    """The report of a contrast as one HTML page that needs nothing else: no network, no script."""
    parts = [
        _head(found),
        section("What changed", *_changes(found)),
        section("What did not change", *_unchanged(found)),
        section("How it was judged", *_judged(found)),
    ]
    return page(f"{found.study.name} - contrast", parts, "Residual = measured - simulated. ")


def _head(found: Contrast) -> Markup:
    counts = ", ".join(f"{g}: {sum(t.group == g for t in found.study.trials)} trials" for g in found.groups)
    words = found.headline()
    style = {"nothing_changed": "adequate", "changed": "causes_found", "unexplained": "unexplained"}.get(
        found.verdict, "stopped"
    )
    return element(
        "header",
        element("p", f"{found.study.name} \u00b7 rig {found.study.rig} \u00b7 {counts}", class_="eyebrow"),
        element("h1", words[0].upper() + words[1:], class_=f"verdict {style}"),
        *(element("p", element("strong", "Warning: "), f"{words}.") for words in found.warnings),
    )


def _changes(found: Contrast) -> list[Markup]:
    if not found.changes:
        return [element("p", "No difference is larger than noise, and than what repeats differ by.")]
    return [_change(c, found.groups) for c in found.changes]


def _change(change: Change, groups: tuple[str, ...]) -> Markup:
    rows: list[list[Content]] = []
    for name, by_group in change.parameters.items():
        unit = unit_text(next(iter(by_group.values())).unit)
        rows.append([element("code", name), unit, *(_value(by_group, g) for g in groups)])
    told = told_apart(change.equivalents, "change")
    first = next(iter(change.parameters))
    return card(
        element("h3", element("code", change.name)),
        element("p", change.words[0].upper() + change.words[1:] + "."),
        html_table(("parameter", "unit", *groups), rows, range(2, 2 + len(groups))),
        figure(_drawing(change, groups), f"{first} in each group, with its 95 % interval.", "narrow", change.name),
        element("p", f"{told} Over the whole library {probability(change.p_value)}."),
    )


def _value(by_group: Mapping[str, ParameterEstimate], group: str) -> str:
    if group not in by_group:
        return "-"
    one = by_group[group]
    value, interval = value_and_interval(one)
    return f"{value} {interval if interval.startswith('[') else f'({interval})'}" if one.std else "none"


def _drawing(change: Change, groups: tuple[str, ...]) -> Drawing:
    """The first parameter of a change by group: a dot, and its 95 % interval."""
    name, by_group = next(iter(change.parameters.items()))
    rows: list[tuple[str, float, float, float]] = []
    for group in (g for g in groups if g in by_group):
        one = by_group[group]
        low, high = (end if math.isfinite(end) else one.value for end in one.interval)
        rows.append((group, one.value, low, high))
    low, high = min(r[2] for r in rows), max(r[3] for r in rows)
    room = 0.08 * max(high - low, 1e-12)
    panel = named_rows([r[0] for r in rows], ["ink"] * len(rows), (low - room, high + room))
    for k, (_, value, below, above) in enumerate(rows):
        panel.line([below, above], [-k, -k], "ink", 2.6)
        panel.dot(value, -k, "ink")
    panel.x_axis(f"{name} ({unit_text(next(iter(by_group.values())).unit)})")
    words = "; ".join(f"{g} {v:.4g}, interval {a:.4g} to {b:.4g}" for g, v, a, b in rows)
    head = ("group", name, "low", "high")
    csv = rows_csv(head, [(g.replace(",", " "), *numbers) for g, *numbers in rows])
    return rows_drawing(panel, len(rows), f"{name} in each group: {words}.", csv)


def _unchanged(found: Contrast) -> list[Markup]:
    out = []
    if found.unchanged:
        rows: list[list[Content]] = [[element("code", n), f"{100.0 * v:.2g} %"] for n, v in found.unchanged.items()]
        out.append(element("p", "A change of these beyond the size stated would have been seen in 95 of 100 studies:"))
        out.append(html_table(("parameter of the model", "at most, of its value"), rows, (1,)))
    if found.excluded:
        rows = [[element("code", n), f"{p.value:.2g}", unit_text(p.unit)] for n, p in found.excluded.items()]
        out.append(element("p", "These causes did not come in any group, beyond the size stated:"))
        out.append(html_table(("cause", "at most", "unit"), rows, (1,)))
    if found.untestable:
        names = ", ".join(found.untestable)
        out.append(element("p", f"Could have changed unseen, which is not the same as unchanged: {names}."))
    return out


def _judged(found: Contrast) -> list[Markup]:
    how = (
        "by predictions one sample ahead, as a controller answers the reading"
        if found.driven
        else "by simulations from the inputs alone"
    )
    text = (
        f"One model was fitted to all groups, {how}, with noise of each group's own. A change is named where it stands "
        "out of the noise and out of what repeats of one group differ by, over the whole library."
    )
    return [element("p", text), *(element("p", n[0].upper() + n[1:] + ".", class_="soft") for n in _said(found))]


def _said(found: Contrast) -> list[str]:
    return [n for n in found.notes() if n.startswith(SAID)]
