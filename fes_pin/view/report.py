"""The report of a diagnosis: one page that holds everything it shows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from fes_pin.data.files import write_text
from fes_pin.diagnose.diagnosis import Cause, Diagnosis
from fes_pin.diagnose.missing import missing_input
from fes_pin.diagnose.record import NEXT_FILE
from fes_pin.diagnose.replay import Replay, replay
from fes_pin.diagnose.text import headline
from fes_pin.identify.fit import Fit
from fes_pin.models.describe import equation, remark, sentence
from fes_pin.models.effects import effect
from fes_pin.view.page import (
    Content,
    Markup,
    element,
    figure,
    joined,
    page,
    percent,
    probability,
    rounded,
    section,
    table,
)
from fes_pin.view.plots import by_kind, missing_figure, stimulus_figure, trial_figure
from fes_pin.view.ranking import gain_figure, rivals_figure, shown_rivals
from fes_pin.view.style import unit_of
from fes_pin.view.svg import inline_svg

DRAWN = 8
"""Trials that are drawn; the table has them all."""


def report(diagnosis: Diagnosis, path: str | Path) -> None:
    """Write the report of a diagnosis, whole or not at all.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    write_text(path, report_html(diagnosis))


def report_html(diagnosis: Diagnosis) -> str:
    """The report of a diagnosis as one HTML page that needs nothing else: no network, no script."""
    replays = replay(diagnosis)
    parts = [
        _head(diagnosis),
        section("Causes", *_causes(diagnosis)),
        section("What is left", *_left(diagnosis)),
        section("Next experiment", *_next(diagnosis)),
        section("Missing torque and force", *_missing(diagnosis, replays)),
        section("Trials", *_trials(diagnosis, replays)),
        section("Parameters and noise", *_parameters(diagnosis)),
        section("The model, to be used", *_use(diagnosis)),
        element("footer", "Made by fes-pin. Residual = measured - simulated. Intervals are 95 %. SI units."),
    ]
    return page(f"{diagnosis.study.name} - diagnosis", joined([p for p in parts if p.text]))


def position_unit(diagnosis: Diagnosis) -> str:
    """Unit of the joint's position: "m" for a prismatic one."""
    return "m" if diagnosis.model.rig.constants.get("revolute", 1.0) == 0.0 else "rad"


def _head(diagnosis: Diagnosis) -> Markup:
    study = diagnosis.study
    kinds = " and ".join(f"{n} {kind}" for kind, n in Counter(t.kind for t in study.trials).items())
    seconds = sum(t.duration for t in study.trials)
    words = headline(diagnosis)
    partly = " partly" if diagnosis.causes and diagnosis.remainder.unexplained else ""
    return element(
        "header",
        element("p", f"{study.name} · rig {study.rig} · {kinds} trials, {seconds:.4g} s", class_="eyebrow"),
        element("h1", words[0].upper() + words[1:], class_=f"verdict {diagnosis.verdict}{partly}"),
        _facts(diagnosis),
    )


def _facts(diagnosis: Diagnosis) -> Markup:
    before, after = diagnosis.nominal_error, diagnosis.extended_error
    left = diagnosis.remainder
    rows: list[tuple[str, str, str]] = []
    for k, where in enumerate(("on the fitted trials", "held out")):
        if before[k] is not None and after[k] is not None:
            shown = f"{percent(before[k])} → {percent(after[k])}" if diagnosis.causes else percent(before[k])
            by = diagnosis.held_out_by if k else "nominal → extended" if diagnosis.causes else "nominal"
            rows.append((f"error E, {where}", shown, by))
    rows.append(("noise floor of E", percent(diagnosis.ceiling_percent), "no model can be better"))
    state = "something" if left.unexplained else "nothing"
    rows.append(("left unexplained", state, probability(left.p_value)))
    cells = [element("div", element("dt", t), element("dd", v, element("small", note))) for t, v, note in rows]
    return element("dl", joined(cells), class_="facts")


def _stage(stage: str) -> Markup:
    return element("span", stage, class_=f"stage {stage}")


def _causes(diagnosis: Diagnosis) -> list[Markup]:
    if not diagnosis.causes:
        return [element("p", "None is named: no cause in the library earned its place on these data.")]
    rows: list[list[Content]] = [
        [
            element("code", c.name),
            _stage(c.stage),
            _gain_text(c),
            probability(c.p_value).removeprefix("p = ").removeprefix("p "),
            ", ".join(c.equivalents) or "-",
        ]
        for c in diagnosis.causes
    ]
    shown = inline_svg(gain_figure(diagnosis.causes), "Held-out gain of each cause")
    caption = (
        "Gain on held-out trials with its 95 % interval: percent of the nominal model's squared error above noise."
    )
    return [
        table(("cause", "stage", "held-out gain [95 %]", "p", "cannot be told from"), rows, (2, 3)),
        figure(shown, caption, "narrow"),
        *(_cause(diagnosis, c) for c in diagnosis.causes),
    ]


def _rivals(diagnosis: Diagnosis, cause: Cause) -> Markup:
    if not shown_rivals(diagnosis, cause):
        return Markup("")
    shown = inline_svg(rivals_figure(diagnosis, cause), f"Rivals of {cause.name} by their shortfall")
    caption = (
        f"Rivals in place of {cause.name}: by how much twice the log-likelihood of the whole fit falls. Hollow, or in "
        "the grey band: not told apart. Colours are the stages of the signal path."
    )
    return figure(shown, caption, "narrow")


def _gain_text(cause: Cause) -> str:
    held = cause.gain_held_out
    return f"{held.percent:.0f} % [{held.low:.0f}, {held.high:.0f}]"


def _cause(diagnosis: Diagnosis, cause: Cause) -> Markup:
    kind = effect(cause.name)
    told = (
        f"These data cannot tell it from {', '.join(cause.equivalents)}: read them as one set."
        if cause.equivalents
        else "These data tell it apart from every other cause in the library."
    )
    gain = (
        f"It removes {_gain_text(cause)} of the error above the noise on held-out trials "
        f"({cause.gain_fit:.0f} % on the fitted ones)."
    )
    return element(
        "article",
        element(
            "div",
            element("h3", element("code", cause.name), " ", _stage(cause.stage)),
            element("p", sentence(kind)),
            element("pre", equation(kind)),
            _estimates(diagnosis.extended, cause),
            element("p", gain, " ", told),
            element("p", f"Tell-tale: {remark(kind, 'Tell-tale:')}", class_="soft"),
            _rivals(diagnosis, cause),
        ),
        class_=f"cause {cause.stage}",
    )


def _estimates(fitted: Fit, cause: Cause) -> Markup:
    rows: list[list[Markup | str]] = []
    for name, one in cause.parameters.items():
        shown, interval = _value(fitted, f"{cause.name}.{name}", one.value)
        rows.append([element("code", name), shown, one.unit or "1", interval])
    return table(("parameter", "value", "unit", "95 % interval"), rows, (1, 3))


def _value(fitted: Fit, name: str, value: float) -> tuple[str, str]:
    """Value and interval of a parameter as printed."""
    if name not in fitted.free:
        return f"{value:.4g}", "held"
    std = fitted.std(name)
    if name in fitted.not_identified():
        return f"{value:.3g}", "not identified"
    low, high = fitted.interval(name)
    at = " at its bound" if name in fitted.at_bound else ""
    return rounded(value, std), f"[{rounded(low, std)}, {rounded(high, std)}]{at}"


def _left(diagnosis: Diagnosis) -> list[Markup]:
    left = diagnosis.remainder
    where = f" It depends most on {left.where}." if left.where else ""
    told = (
        f"Something is left that the {'extended' if diagnosis.causes else 'nominal'} model does not explain "
        f"({probability(left.p_value)}).{where}"
        if left.unexplained
        else f"Nothing that smooth functions of the motion could still explain ({probability(left.p_value)})."
    )
    out = [element("p", told)]
    if diagnosis.absorbed:
        out.append(element("p", "Not testable here, which is not the same as absent: the nominal parameters take up"))
        rows: list[list[Content]] = [
            [element("code", n), _stage(str(effect(n).stage)), sentence(effect(n))] for n in diagnosis.absorbed
        ]
        out.append(table(("cause", "stage", "what it is"), rows))
    else:
        out.append(element("p", "Every other cause in the library could have been seen by these data.", class_="soft"))
    return out


def _next(diagnosis: Diagnosis) -> list[Markup]:
    plan = diagnosis.next_experiment
    if plan is None:
        text = "None is needed to tell causes apart." if diagnosis.causes else "There are no causes to tell apart."
        return [element("p", text, class_="soft")]
    out = [element("p", f"To separate {' and '.join(plan.separates)}: {plan.why}.")]
    if plan.trial is None:
        return out
    conditions = "".join(f", {n} = {v:g}" for n, v in plan.trial.conditions.items())
    out.append(
        element("p", f"A {plan.trial.kind} trial{conditions}; its inputs are in ", element("code", NEXT_FILE), ".")
    )
    if plan.trial.columns:
        drawn = inline_svg(stimulus_figure(plan.trial, position_unit(diagnosis)), "Inputs of the next trial")
        out.append(figure(drawn, class_="narrow"))
    return out


def _missing(diagnosis: Diagnosis, replays: Sequence[Replay]) -> list[Markup]:
    before = [missing_input(diagnosis.nominal.model, r.measured, r.nominal) for r in replays]
    after = [missing_input(diagnosis.model, r.measured, r.extended) for r in replays] if diagnosis.causes else []
    out = [
        element(
            "p",
            "What would have to be added to the model's torque (or force) at each instant to make it right: the "
            "smoothed residual, taken through the inertia, damping and stiffness of the rig. A cause shows as a "
            "function of what it depends on.",
        )
    ]
    for kind, chosen in by_kind(before).items():
        drawing = missing_figure(
            [before[k] for k in chosen], [after[k] for k in chosen] if after else [], position_unit(diagnosis)
        )
        caption = (
            f"Missing {kind} of {len(chosen)} trial{'s' if len(chosen) > 1 else ''}. Lines join medians; the "
            "percentage is the share of its variance that is a function of that variable alone."
        )
        out.append(figure(inline_svg(drawing, f"Missing {kind} against each variable"), caption, "wide"))
    return out


def _trials(diagnosis: Diagnosis, replays: Sequence[Replay]) -> list[Markup]:
    extended = bool(diagnosis.causes)
    noise, unit = diagnosis.extended.noise, position_unit(diagnosis)
    drawn = []
    for k in _chosen(replays):
        one = replays[k]
        svg = inline_svg(trial_figure(one, noise, unit, extended), f"Trial {k + 1}: measured, simulated and residual")
        drawn.append(figure(svg, _trial_caption(one, extended)))
    words = (
        "Grey: the nominal model, fitted. Blue: the extended one. " if extended else "Grey: the nominal model, fitted. "
    )
    left_out = f" Drawn are the {len(drawn)} of {len(replays)} that the nominal model misses most."
    text = f"{words}The band is twice the noise's standard deviation.{left_out if len(drawn) < len(replays) else ''}"
    return [
        element("p", text, class_="soft"),
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


def _parameters(diagnosis: Diagnosis) -> list[Markup]:
    nominal, extended = diagnosis.nominal, diagnosis.extended
    info = extended.model.parameter_info()
    rows: list[list[Content]] = []
    for name in extended.free:
        before = _value(nominal, name, nominal.values[name]) if name in nominal.free else ("-", "-")
        after = _value(extended, name, extended.values[name]) if diagnosis.causes else ("-", "-")
        start = f"{diagnosis.study.start[name]:.4g}" if name in diagnosis.study.start else "-"
        rows.append([element("code", name), info[name].unit or "1", start, *before, *after])
    head = ("parameter", "unit", "start", "nominal", "95 % interval", "extended", "95 % interval")
    unit = position_unit(diagnosis)
    noise: list[list[Content]] = [
        [element("code", n), f"{m.std:.3g}", unit_of(n, unit), str(len(m.ar)) if m.ar else "white"]
        for n, m in extended.noise.items()
    ]
    return [
        table(head, rows, (2, 3, 4, 5, 6)),
        table(("noise of", "standard deviation", "unit", "autoregressive order"), noise, (1,)),
    ]


def _use(diagnosis: Diagnosis) -> list[Markup]:
    settings = {
        "ankle": " --set load_kg=1.5",
        "muscle": "",
        "joint": " --set position0=0.5 --set velocity0=0",
    }.get(diagnosis.study.rig, "")
    lines = [f"fes-pin predict model.toml TRIAL.csv{settings} --out PREDICTED.csv"]
    if diagnosis.study.rig == "ankle":
        lines.append(
            "fes-pin predict model.toml TRIAL.csv --set kind=isometric --set angle_rad=1.9 --out PREDICTED.csv"
        )
    python = 'import fes_pin as fp\n\nmodel = fp.load_model("model.toml")\npredicted = fp.predict(model, trial)'
    inputs = ", ".join(diagnosis.model.rig.input_columns(diagnosis.study.trials[0])) or "nothing else"
    return [
        element("p", "The ", element("code", "model.toml"), " beside this page is the extended model, whole. "
                f"TRIAL.csv needs the columns time_s and {inputs}."),
        element("pre", "\n".join(lines)),
        element("pre", python),
    ]  # fmt: skip
