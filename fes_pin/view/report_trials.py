"""The part of the report that shows the trials: curves, residuals, missing torque."""

from __future__ import annotations

from collections.abc import Sequence

from fes_pin.diagnose.replay import Replay
from fes_pin.diagnose.result import Diagnosis
from fes_pin.view.missing import missing_input
from fes_pin.view.page import Markup, element, figure, joined, key, percent, table
from fes_pin.view.plots import by_kind, missing_figure, share, trial_figure
from fes_pin.view.svg import inline_svg

DRAWN = 8
"""Trials that are drawn; the table has them all."""


def position_unit(diagnosis: Diagnosis) -> str:
    """Unit of the joint's position: "m" for a prismatic one."""
    return diagnosis.model.rig.units()["q"]


def missing_section(diagnosis: Diagnosis, replays: Sequence[Replay]) -> list[Markup]:
    """Missing torque and force against every variable."""
    before = [missing_input(diagnosis.nominal.model, r.measured, r.nominal) for r in replays]
    after = [missing_input(diagnosis.model, r.measured, r.extended) for r in replays] if diagnosis.causes else []
    unit = position_unit(diagnosis)
    out = [
        element(
            "p",
            "What would have to be added to the model's torque (or force) at each instant to make it right: the "
            "smoothed residual, taken through the inertia, damping and stiffness of the rig. A cause shows as a "
            "function of what it depends on. Most telling variable first: the percentage is the share of the variance "
            "that is a function of that variable alone.",
        ),
        key(("nominal", "nominal, instants"), ("measured", "nominal, median"), *_if(bool(after), "extended, median")),
    ]
    for kind, chosen in by_kind(before).items():
        first, second = [before[k] for k in chosen], [after[k] for k in chosen if after]
        drawn = [
            figure(inline_svg(missing_figure(first, second, n, unit, False), f"Missing {kind} against {n}"))
            for n in sorted(first[0].against, key=lambda n: -share(first, n))
        ]
        count = f"{len(chosen)} trial{'s' if len(chosen) > 1 else ''}"
        out.append(element("h3", f"Missing {kind}, {count}"))
        out.append(element("div", joined(drawn), class_="grid three"))
    return out


def _if(there: bool, words: str) -> list[tuple[str, str]]:
    return [("extended", words)] if there else []


def trials_section(diagnosis: Diagnosis, replays: Sequence[Replay]) -> list[Markup]:
    """The trials: figures of those with the largest errors, and a table of all."""
    extended = bool(diagnosis.causes)
    noise, unit = diagnosis.extended.noise, position_unit(diagnosis)
    drawn = []
    for k in _chosen(replays):
        one = replays[k]
        plot = trial_figure(one, noise, unit, extended, legend=False)
        svg = inline_svg(plot, f"Trial {k + 1}: measured, simulated and residual")
        drawn.append(figure(svg, _trial_caption(one, extended)))
    left_out = f" Drawn are the {len(drawn)} of {len(replays)} trials that the nominal model misses most."
    text = (
        "Residual = measured - simulated, as it is (faint) and smoothed; its band is twice the standard deviation of "
        f"the noise.{left_out if len(drawn) < len(replays) else ''}"
    )
    return [
        element("p", text, class_="soft"),
        key(("measured", "measured"), ("nominal", "nominal model, fitted"), *_if(extended, "extended model")),
        element("div", joined(drawn), class_="grid"),
        _trial_table(replays, extended),
    ]


def _chosen(replays: Sequence[Replay]) -> list[int]:
    """Which trials are drawn: those with the largest error, in the order of the study."""
    worst = sorted(range(len(replays)), key=lambda k: -replays[k].nominal_error)[:DRAWN]
    return sorted(worst)


def _conditions(one: Replay) -> str:
    trial = one.measured
    values = "".join(f", {n} = {v:g}" for n, v in trial.conditions.items())
    return f"{trial.kind}{values}{', held out' if trial.role == 'held_out' else ''}"


def _trial_caption(one: Replay, extended: bool) -> Markup:
    after = f" → {percent(one.extended_error)}" if extended else ""
    name = element("strong", one.measured.name)
    return name + element("span", f" · {_conditions(one)} · E {percent(one.nominal_error)}{after}")


def _trial_table(replays: Sequence[Replay], extended: bool) -> Markup:
    head = ["trial", "conditions", "duration (s)", "E nominal"] + ["E extended"] * extended
    rows = [
        [r.measured.name, _conditions(r), f"{r.measured.duration:.4g}", percent(r.nominal_error)]
        + [percent(r.extended_error)] * extended
        for r in replays
    ]
    return table(head, rows, (2, 3, 4))
