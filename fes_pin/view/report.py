"""The report of a diagnosis: one page that holds everything it shows."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from fes_pin.data.files import write_text
from fes_pin.diagnose.record import NEXT_FILE
from fes_pin.diagnose.replay import replay
from fes_pin.diagnose.result import Diagnosis
from fes_pin.diagnose.text import left_out_text
from fes_pin.models.describe import sentence
from fes_pin.models.outside import origin
from fes_pin.view.page import (
    Content,
    Markup,
    element,
    figure,
    joined,
    page,
    percent,
    probability,
    section,
    table,
    unit_text,
)
from fes_pin.view.plots import stimulus_figure
from fes_pin.view.report_causes import causes_section, stage_mark, value_and_interval
from fes_pin.view.report_trials import missing_section, position_unit, trials_section
from fes_pin.view.style import styled, unit_of
from fes_pin.view.svg import inline_svg


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
    with styled():
        return _html(diagnosis)


def _html(diagnosis: Diagnosis) -> str:
    replays = replay(diagnosis)
    parts = [
        _head(diagnosis),
        section("Causes", *causes_section(diagnosis)),
        section("What is left", *_left(diagnosis)),
        section("Next experiment", *(_next(diagnosis) if diagnosis.causes else [])),
        section("Missing torque and force", *missing_section(diagnosis, replays)),
        section("Trials", *trials_section(diagnosis, replays)),
        section("Parameters and noise", *_parameters(diagnosis)),
        section("The model, to be used", *_use(diagnosis)),
        element("footer", "Made by fes-pin. Residual = measured - simulated. Intervals are 95 %. SI units."),
    ]
    return page(f"{diagnosis.study.name} - diagnosis", joined([p for p in parts if p.text]))


def _head(diagnosis: Diagnosis) -> Markup:
    study = diagnosis.study
    kinds = " and ".join(f"{n} {kind}" for kind, n in Counter(t.kind for t in study.trials).items())
    seconds = sum(t.duration for t in study.trials)
    words = diagnosis.headline()
    partly = " partly" if diagnosis.causes and diagnosis.remainder.unexplained else ""
    return element(
        "header",
        element("p", f"{study.name} · rig {study.rig} · {kinds} trials, {seconds:.4g} s", class_="eyebrow"),
        element("h1", words[0].upper() + words[1:], class_=f"verdict {diagnosis.verdict}{partly}"),
        _facts(diagnosis),
        *(element("p", element("strong", "Warning: "), f"{words}.") for words in diagnosis.warnings),
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
    if diagnosis.left_out:
        count = sum(len(k) for columns in diagnosis.left_out.values() for k in columns.values())
        rows.append(
            ("left out as spikes", f"{count} samples", left_out_text(diagnosis.left_out, diagnosis.study.trials))
        )
    state = "something" if left.unexplained else "nothing"
    rows.append(("left unexplained", state, probability(left.p_value)))
    for where, names in diagnosis.catalogue.origins().items():
        rows.append(("looked for as well", ", ".join(names), f"code of {Path(where).name}"))
    cells = [element("div", element("dt", t), element("dd", v, element("small", note))) for t, v, note in rows]
    return element("dl", joined(cells), class_="facts")


def _left(diagnosis: Diagnosis) -> list[Markup]:
    left = diagnosis.remainder
    where = f" It depends most on {left.where}." if left.where else ""
    told = (
        f"Something is left that the {'extended' if diagnosis.causes else 'nominal'} model does not explain "
        f"({probability(left.p_value)}).{where}"
        if left.unexplained
        else "Nothing that depends smoothly on the motion, comes in bursts or waves, repeats with the angle or from "
        "trial to trial, grows with the stimulus, jumps once in a trial or lags where the motion turns "
        f"({probability(left.p_value)})."
    )
    out = [element("p", told)]
    if diagnosis.absorbed:
        why = "what the nominal parameters take up, or no input of these trials drives"
        out.append(element("p", f"Not testable here, which is not the same as absent: {why}"))
        unseen = [diagnosis.catalogue.effect(n) for n in diagnosis.absorbed]
        rows: list[list[Content]] = [[element("code", e.name), stage_mark(str(e.stage)), sentence(e)] for e in unseen]
        out.append(table(("cause", "stage", "what it is"), rows, prose=True))
    else:
        out.append(element("p", "Every other cause in the library could have been seen by these data.", class_="soft"))
    return out


def _next(diagnosis: Diagnosis) -> list[Markup]:
    plan = diagnosis.next_experiment
    if plan is None:
        return [element("p", "None is needed to tell causes apart.", class_="soft")]
    if plan.trial is None:
        return [element("p", f"{plan.why[0].upper()}{plan.why[1:]}.")]
    out = [element("p", f"To separate {' and '.join(plan.separates)}: {plan.why}.")]
    conditions = "".join(f", {n} = {v:g}" for n, v in plan.trial.conditions.items())
    out.append(
        element("p", f"Its kind: {plan.trial.kind}{conditions}; its inputs are in ", element("code", NEXT_FILE), ".")
    )
    if plan.trial.columns:
        drawn = inline_svg(stimulus_figure(plan.trial, position_unit(diagnosis)), "Inputs of the next trial")
        out.append(figure(drawn, class_="narrow"))
    return out


def _parameters(diagnosis: Diagnosis) -> list[Markup]:
    fits = [diagnosis.nominal, diagnosis.extended] if diagnosis.causes else [diagnosis.nominal]
    info = diagnosis.model.parameter_info()
    rows: list[list[Content]] = []
    for name in fits[-1].free:
        start = f"{diagnosis.study.start[name]:.4g}" if name in diagnosis.study.start else "-"
        cells = [value_and_interval(f, name, f.values[name]) if name in f.free else ("-", "-") for f in fits]
        rows.append(
            [element("code", name), unit_text(info[name].unit), start, *(text for pair in cells for text in pair)]
        )
    head = ("parameter", "unit", "start", "nominal", "95 % interval", "extended", "95 % interval")
    unit = position_unit(diagnosis)
    noise: list[list[Content]] = [
        [element("code", n), f"{m.std:.3g}", unit_of(n, unit), str(len(m.ar)) if m.ar else "white"]
        for n, m in diagnosis.extended.noise.items()
    ]
    return [
        table(head[: 3 + 2 * len(fits)], rows, range(2, 7)),
        table(("noise of", "standard deviation", "unit", "autoregressive order"), noise, (1,)),
    ]


def _use(diagnosis: Diagnosis) -> list[Markup]:
    rig = diagnosis.model.rig
    libraries = sorted({Path(where).name for one in (rig, *diagnosis.model.effects) if (where := origin(type(one)))})
    options = "".join(f" --library {name}" for name in libraries)
    lines = [
        f"fes-pin predict model.toml TRIAL.csv {one}{options} --out PREDICTED.csv".replace("  ", " ")
        for one in rig.settings
    ]
    columns = " and ".join(("time_s", *rig.input_columns(diagnosis.study.trials[0])))
    first = f" {rig.begins}" if rig.begins else ""
    which = "extended" if diagnosis.causes else "fitted nominal"
    words = f" beside this page is the {which} model, whole. TRIAL.csv needs {columns}.{first}"
    library = f", library={libraries}".replace("'", '"') if libraries else ""
    python = (
        f'import fes_pin as fp\n\nmodel = fp.load_model("model.toml"{library})\npredicted = fp.predict(model, trial)'
    )
    return [
        element("p", "The file ", element("code", "model.toml"), words),
        element("pre", "\n".join(lines)),
        element("pre", python),
    ]
