"""The report of a walking diagnosis: one page that holds everything it shows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fes_pin.infer.text import percent, probability
from fes_pin.models.describe import sentence
from fes_pin.view.chart import Panel, svg
from fes_pin.view.drawing import Drawing, csv_of, every
from fes_pin.view.page import Content, Markup, element, figure, html_table, joined, key, page, section
from fes_pin.view.style import thin_curve
from fes_pin.walk.effects import EFFECTS
from fes_pin.walk.judge import CHANNELS
from fes_pin.walk.record import BODY_FILE
from fes_pin.walk.result import WalkDiagnosis

PLAYBACK_FILE = "playback.html"
SHOWN_S = 4.0
"""Of each trial, s."""
WIDE, ROW, AXIS = 420.0, 160.0, 66.0
"""Width of a figure's half and height of a channel, room for the axis on the left."""


def walk_report_html(diagnosis: WalkDiagnosis) -> str:
    """The report as one HTML page that needs nothing else: no network, no script."""
    words = diagnosis.headline()
    strides = diagnosis.models.banks.strides.count
    partly = " partly" if diagnosis.causes and diagnosis.remainder.unexplained else ""
    head = element(
        "header",
        element("p", f"{diagnosis.study.name} · rig body · {strides} strides", class_="eyebrow"),
        element("h1", words[0].upper() + words[1:], class_=f"verdict {diagnosis.verdict}{partly}"),
        _facts(diagnosis),
    )
    notes = [element("p", note[0].upper() + note[1:] + ".") for note in diagnosis.notes()[1:]]
    parts = [
        head,
        section("Causes", *_causes(diagnosis)),
        section("What is left", *notes),
        section("Ground reaction", *_trials(diagnosis)),
        section("Not testable here", *_absorbed(diagnosis)),
        section("The body, to be used", *_use(diagnosis)),
    ]
    return page(f"{diagnosis.study.name} - diagnosis", parts, "Residual = measured - required. ")


def _facts(diagnosis: WalkDiagnosis) -> Markup:
    before, after, rows = diagnosis.nominal_error, diagnosis.extended_error, []
    for k, where in enumerate(("on all strides", "strides held out")):
        if before[k] is not None:
            shown = f"{percent(before[k])} → {percent(after[k])}" if diagnosis.causes else percent(before[k])
            rows.append((f"error E, {where}", shown, "nominal → extended" if diagnosis.causes else "nominal"))
    rows.append(("stride to stride", percent(diagnosis.ceiling_percent), "of E: no model of the mean stride takes it"))
    state = "something" if diagnosis.remainder.unexplained else "nothing"
    rows.append(("comes again in every stride", state, probability(diagnosis.remainder.p_value)))
    cells = [element("div", element("dt", t), element("dd", v, element("small", note))) for t, v, note in rows]
    return element("dl", joined(cells), class_="facts")


def _causes(diagnosis: WalkDiagnosis) -> list[Markup]:
    if not diagnosis.causes:
        return []
    rows: list[list[Content]] = []
    for cause in diagnosis.causes:
        name, site, values, held, others = cause.row()
        rows.append([element("code", name), site, values, held, others, probability(cause.p_value)])
    head = ("cause", "site", "parameters", "held-out gain", "cannot be told from", "by chance")
    return [html_table(head, rows)]


def _absorbed(diagnosis: WalkDiagnosis) -> list[Markup]:
    if not diagnosis.absorbed:
        return []
    catalogue: tuple[Any, ...] = EFFECTS
    said = {e.name: sentence(e) for e in catalogue}
    rows: list[list[Content]] = [[element("code", n), said[n]] for n in diagnosis.absorbed]
    return [
        element("p", "Not testable is not the same as absent: soft tissue and noise hide these at their usual size."),
        html_table(("cause", "what it is"), rows, prose=True),
    ]


def _use(diagnosis: WalkDiagnosis) -> list[Markup]:
    python = (
        f'import fes_pin as fp\n\nbody = fp.Body.from_urdf("{BODY_FILE}")\nlinear = fp.linearize(body, "mid_stance")'
    )
    return [
        element("p", f"The extended body stands beside this page, the walk to be watched in {PLAYBACK_FILE}."),
        element("pre", python),
    ]


def _trials(diagnosis: WalkDiagnosis) -> list[Markup]:
    banks, best = diagnosis.models.banks, diagnosis.best
    legend = key(("measured", "measured"), ("nominal", "required"), ("extended", "required by the extended model"))
    out = [legend]
    for number, scene in enumerate(banks.as_read.scenes):
        made = None
        if best.names:
            with_it = banks.bank(best.names).scenes[number]
            made = scene.measured - (with_it.residual - banks.signals(best.names, with_it) @ best.fitted.values)
        curves = {"measured": scene.measured, "nominal": scene.needed} | ({} if made is None else {"extended": made})
        single = scene.plates.loaded["left"] ^ scene.plates.loaded["right"]
        drawn = _drawing(scene.name, scene.motion.time, curves, single)
        out.append(
            figure(
                drawn, f"Trial {scene.name}, at most {SHOWN_S:g} s of it; single supports are shaded.", file=scene.name
            )
        )
    return out


def _drawing(trial: str, time: np.ndarray, curves: Mapping[str, np.ndarray], single: np.ndarray) -> Drawing:
    """Six channels about the centre of mass, forces on the left and moments on the right.

    Parameters
    ----------
    curves
        Each of shape (n, 6), by the name of its colour.
    single
        Shape (n,): whether one foot alone is on the ground.
    """
    shown = time <= time[0] + SHOWN_S
    time, edges = time[shown], np.flatnonzero(np.diff(single[shown], prepend=False, append=False))
    panels, columns = [], {"time_s": time}
    for channel, name in enumerate(CHANNELS):
        unit = "N" if channel < 3 else "N m"
        own = {of: values[shown, channel] for of, values in curves.items()}
        columns |= {f"{name.replace(' ', '_')}_{of}": values for of, values in own.items()}
        low, high = min(v.min() for v in own.values()), max(v.max() for v in own.values())
        room = 0.05 * (high - low) or 1.0
        left = AXIS + (channel // 3) * WIDE
        panel = Panel(left, 8.0 + (channel % 3) * ROW, WIDE - AXIS - 8.0, ROW - 16.0, (time[0], time[-1]),
                      (low - room, high + room))  # fmt: skip
        for begin, end in edges.reshape(-1, 2).tolist():
            panel.box((time[begin], time[end - 1]), panel.y, "band")
        for of, values in own.items():
            panel.line(*thin_curve(time, values), of, 1.3)
        panel.y_axis(f"{name} ({unit})".replace(" about", "\nabout"), title_at=left - AXIS + 26.0)
        if channel % 3 == 2:
            panel.x_axis("time (s)")
        panels.append(panel)
    words = f"Ground reaction of trial {trial} in six channels: {', '.join(CHANNELS)}."
    step = every(len(time))
    note = f"every {step}. sample" if step > 1 else ""
    return Drawing(svg(panels, 2.0 * WIDE, 3.0 * ROW + 30.0, words), csv_of(columns, step), note)
