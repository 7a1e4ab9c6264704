"""The part of the report that shows the trials: curves, residuals, missing torque."""

from __future__ import annotations

from collections.abc import Sequence

from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.replay import Replay
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.infer.text import percent
from fes_pin.models.model import Model
from fes_pin.models.tracking import can_track
from fes_pin.view.missing import Missing, missing_along, missing_input
from fes_pin.view.page import Content, Markup, element, figure, folded, html_table, joined, key
from fes_pin.view.plots import by_kind, missing_drawing, points_of, share, trial_drawing

OPEN = 4
"""Trials that are drawn at once, those that the nominal model misses most; the others are folded."""
WORSE = 0.01
"""Share by which a trial's error must grow to count as worse: less is the noise of one trial's fit."""


def position_unit(diagnosis: Diagnosis) -> str:
    """Unit of the joint's position: "m" for a prismatic one."""
    return diagnosis.model.rig.units()["q"]


def missing_section(diagnosis: Diagnosis, replays: Sequence[Replay]) -> list[Markup]:
    """Missing torque and force against every variable."""
    before = _missing(diagnosis, diagnosis.nominal.model, [r.nominal for r in replays], replays)
    after = _missing(diagnosis, diagnosis.model, [r.extended for r in replays], replays) if diagnosis.causes else []
    unit = position_unit(diagnosis)
    along = diagnosis.over_horizon is not None and any(_is_tracked(diagnosis.model, r.measured) for r in replays)
    how = (
        "the effort of a stiff servo that keeps the model on the measured motion. No free simulation takes part, for "
        "this rig's would run away"
        if along
        else "the smoothed residual, taken through the inertia, damping and stiffness of the rig"
    )
    text = (
        f"What would have to be added to the model's torque (or force) at each instant to make it right: {how}. A "
        "cause shows as a function of what it depends on. Most telling variable first: the percentage is the share of "
        "the variance that is a function of that variable alone."
    )
    extended = [("extended", "extended, median")] if after else []
    out = [
        element("p", text),
        key(("nominal", "nominal, instants"), ("measured", "nominal, median"), *extended),
    ]
    for kind, chosen in by_kind(before).items():
        first, second = [before[k] for k in chosen], [after[k] for k in chosen if after]
        drawn = [
            figure(missing_drawing(first, second, n, unit), file=f"missing_{kind}_against_{n}")
            for n in sorted(first[0].against, key=lambda n: -share(first, n))
        ]
        count = f"{len(chosen)} trial{'s' if len(chosen) > 1 else ''}"
        out.append(element("h3", f"Missing {kind}, {count}"))
        out.append(element("div", joined(drawn), class_="grid three"))
    return out


def _missing(
    diagnosis: Diagnosis, model: Model, simulated: Sequence[Trial], replays: Sequence[Replay]
) -> list[Missing]:
    runs_away = diagnosis.over_horizon is not None
    return [
        missing_along(model, r.measured)
        if runs_away and _is_tracked(model, r.measured)
        else missing_input(model, r.measured, one)
        for r, one in zip(replays, simulated, strict=True)
    ]


def _is_tracked(model: Model, trial: Trial) -> bool:
    """True where a servo can keep the model on the motion: an imposed one needs none."""
    return can_track(model) and trial.kind != IMPOSED


def trials_section(diagnosis: Diagnosis, replays: Sequence[Replay]) -> list[Markup]:
    """The trials: a table and a figure of each, those with small errors folded."""
    extended = bool(diagnosis.causes)
    noise, unit, points = diagnosis.extended.noise, position_unit(diagnosis), points_of(len(replays))

    def drawn(k: int) -> Markup:
        one = replays[k]
        made = trial_drawing(one, noise, unit, extended, points)
        return figure(made, _trial_caption(one, extended), file=f"trial_{k + 1}")

    worst = set(sorted(range(len(replays)), key=lambda k: -replays[k].nominal_error)[:OPEN])
    others = [k for k in range(len(replays)) if k not in worst]
    span = diagnosis.over_horizon
    ahead = f"Simulated: {span.horizon_s:g} s ahead of what was measured, for it is driven. " if span else ""
    text = (
        f"{ahead}Residual = measured - simulated, as it is (faint) and smoothed; its band is twice the standard "
        "deviation of the noise."
    )
    names = [("measured", "measured"), ("nominal", "nominal model, fitted")]
    out = [
        element("p", text, class_="soft"),
        *_worse_note(replays, extended),
        key(*names, *([("extended", "extended model")] if extended else [])),
        element("div", joined([drawn(k) for k in sorted(worst)]), class_="grid"),
    ]
    if others:
        few = f"the other {len(others)} trials, which" if len(others) > 1 else "the other trial, which"
        rest = element("div", joined([drawn(k) for k in others]), class_="grid")
        out.append(folded(f"Show {few} the nominal model misses less", rest))
    return [*out, _trial_table(replays, extended)]


def got_worse(one: Replay) -> bool:
    """True if the extended model misses a trial by more than the nominal one, and by more than noise makes it."""
    return one.extended_error > (1.0 + WORSE) * one.nominal_error


def _worse_note(replays: Sequence[Replay], extended: bool) -> list[Markup]:
    worse = [r.measured.name for r in replays if extended and got_worse(r)]
    if not worse:
        return []
    which = f"{len(worse)} of {len(replays)} trials" if len(worse) > 1 else "One trial"
    return [element("p", _flag(), f" {which} got worse with the extended model: {', '.join(worse)}.")]


def _flag() -> Markup:
    return element("strong", "worse", class_="worse")


def _conditions(one: Replay) -> str:
    trial = one.measured
    values = "".join(f", {n} = {v:g}" for n, v in trial.conditions.items())
    return f"{trial.kind}{values}{', held out' if trial.role == 'held_out' else ''}"


def _trial_caption(one: Replay, extended: bool) -> Markup:
    after = f" → {percent(one.extended_error)}" if extended else ""
    name = element("strong", one.measured.name)
    said = element("span", f" · {_conditions(one)} · E {percent(one.nominal_error)}{after} ")
    return name + said + (_flag() if extended and got_worse(one) else Markup(""))


def _trial_table(replays: Sequence[Replay], extended: bool) -> Markup:
    head = ["trial", "conditions", "duration (s)", "E nominal"] + ["E extended"] * extended
    rows: list[list[Content]] = []
    for r in replays:
        row: list[Content] = [r.measured.name, _conditions(r), f"{r.measured.duration:.4g}", percent(r.nominal_error)]
        if extended:
            shown = element("span", percent(r.extended_error), " ")
            row.append(shown + (_flag() if got_worse(r) else Markup("")))
        rows.append(row)
    return html_table(head, rows, (2, 3, 4))
