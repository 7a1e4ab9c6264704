"""The report of a walking diagnosis: one page that holds everything it shows."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from fes_pin.diagnosis.text import percent, probability
from fes_pin.models.describe import sentence
from fes_pin.view.page import Content, Markup, element, figure, html_table, joined, key, page, section
from fes_pin.view.style import EXTENDED, FAINT, MEASURED, NOMINAL
from fes_pin.view.svg import WIDTH, inline_svg, styled
from fes_pin.walk.effects import EFFECTS
from fes_pin.walk.judge import CHANNELS
from fes_pin.walk.record import BODY_FILE
from fes_pin.walk.result import WalkDiagnosis, walk_cause_row

PLAYBACK_FILE = "playback.html"


def walk_report_html(diagnosis: WalkDiagnosis) -> str:
    """The report as one HTML page that needs nothing else: no network, no script."""
    with styled():
        return _html(diagnosis)


def _html(diagnosis: WalkDiagnosis) -> str:
    words = diagnosis.headline()
    strides = diagnosis.search.banks.strides.count
    partly = " partly" if diagnosis.causes and diagnosis.remainder.unexplained else ""
    head = element(
        "header",
        element("p", f"{diagnosis.study.name} · rig body · {strides} strides", class_="eyebrow"),
        element("h1", words[0].upper() + words[1:], class_=f"verdict {diagnosis.verdict}{partly}"),
        _facts(diagnosis),
    )
    notes = [element("p", note[0].upper() + note[1:] + ".") for note in diagnosis.footnotes()[1:]]
    parts = [
        head,
        section("Causes", *_causes(diagnosis)),
        section("What is left", *notes),
        section("Ground reaction", *_trials(diagnosis)),
        section("Not testable here", *_absorbed(diagnosis)),
        section("The body, to be used", *_use(diagnosis)),
        element("footer", "Made by fes-pin. Residual = measured - required. Intervals are 95 %. SI units."),
    ]
    return page(f"{diagnosis.study.name} - diagnosis", joined([p for p in parts if p.text]))


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
        name, site, values, held, others = walk_cause_row(cause)
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
    banks, best = diagnosis.search.banks, diagnosis.best
    legend = key(("measured", "measured"), ("nominal", "required"), ("extended", "required by the extended model"))
    out = [legend]
    for number, scene in enumerate(banks.as_read.scenes):
        made = None
        if best.forms:
            with_it = banks.bank(best.forms).scenes[number]
            columns = np.concatenate([banks.forms[i].columns(with_it) for i in best.forms], axis=2)
            made = scene.measured - (with_it.residual - columns @ best.fitted.values)
        drawn = _figure(scene.motion.time, scene.measured, scene.needed, made, scene.plates.loaded)
        out.append(figure(inline_svg(drawn, f"Ground reaction of trial {scene.name}"), scene.name))
    return out


def _figure(
    time: np.ndarray, measured: np.ndarray, needed: np.ndarray, made: np.ndarray | None, loaded: dict[str, np.ndarray]
) -> Figure:
    """Six channels about the centre of mass over the first strides; single supports are shaded."""
    shown = time <= time[0] + 4.0
    figure_ = Figure(figsize=(2.0 * WIDTH, 5.4), layout="constrained")
    axes = figure_.subplots(3, 2, sharex=True)
    for channel, panel in enumerate(axes.T.ravel()):
        single = loaded["left"] ^ loaded["right"]
        panel.fill_between(time[shown], 0, 1, where=single[shown], transform=panel.get_xaxis_transform(), color=FAINT,
                           alpha=0.35, lw=0)  # fmt: skip
        panel.plot(time[shown], measured[shown, channel], color=MEASURED, lw=1.4)
        panel.plot(time[shown], needed[shown, channel], color=NOMINAL, lw=1.2)
        if made is not None:
            panel.plot(time[shown], made[shown, channel], color=EXTENDED, lw=1.2)
        panel.set_ylabel(f"{CHANNELS[channel]}\n({'N' if channel < 3 else 'N m'})", fontsize=8.5)
    for panel in axes[2]:
        panel.set_xlabel("time (s)")
    return figure_
