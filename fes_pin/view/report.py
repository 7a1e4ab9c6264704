"""The report of a diagnosis: one page that holds everything it shows."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from fes_pin.data.files import write_text
from fes_pin.data.log import Log
from fes_pin.data.numbers import instance
from fes_pin.diagnosis.errors_ahead import Ahead
from fes_pin.diagnosis.recorded import NEXT_FILE
from fes_pin.diagnosis.replay import replayed_trials
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.diagnosis.text import left_out_text
from fes_pin.identify.error_measures import E_WORDS, FREE, ONE_STEP
from fes_pin.infer.result import ParameterEstimate
from fes_pin.infer.text import percent, probability
from fes_pin.models.describe import sentence
from fes_pin.models.outside import origin
from fes_pin.view.page import (
    Content,
    Markup,
    element,
    figure,
    folded,
    html_table,
    page,
    section,
    unit_text,
)
from fes_pin.view.plots import stimulus_drawing
from fes_pin.view.report_causes import causes_section, stage_mark, value_and_interval
from fes_pin.view.report_trials import missing_section, position_unit, trials_section
from fes_pin.view.style import unit_of
from fes_pin.view.words import answers, title

if TYPE_CHECKING:
    from fes_pin.walk.result import WalkDiagnosis


def report(diagnosis: Diagnosis | WalkDiagnosis, path: str | Path) -> None:
    """Write the report of a diagnosis, of a rig's or of walking's, whole or not at all.

    Raises
    ------
    InputError
        It is no diagnosis; or the file cannot be written, or was read.
    """
    if isinstance(diagnosis, Diagnosis):
        write_text(path, report_html(diagnosis))
        return
    from fes_pin.view.walk_report import walk_report_html  # noqa: PLC0415
    from fes_pin.walk.result import WalkDiagnosis  # noqa: PLC0415

    write_text(path, walk_report_html(instance(diagnosis, WalkDiagnosis, "diagnosis")))


def report_html(diagnosis: Diagnosis) -> str:
    """The report of a diagnosis as one HTML page that needs nothing else: no network."""
    replays = replayed_trials(diagnosis)
    parts = [
        _head(diagnosis),
        section("Errors", *_errors(diagnosis)),
        section("Causes", *causes_section(diagnosis)),
        section("What is left", *_left(diagnosis)),
        section("Next experiment", *(_next(diagnosis) if diagnosis.causes else [])),
        section("Missing torque and force", *missing_section(diagnosis, replays)),
        section("Trials", *trials_section(diagnosis, replays)),
        section("Parameters and noise", *_parameters(diagnosis)),
        section("The model, to be used", *_use(diagnosis)),
        section("Where this comes from", *_provenance(diagnosis)),
    ]
    return page(f"{diagnosis.study.name} - diagnosis", parts, "Residual = measured - simulated. ")


def _head(diagnosis: Diagnosis) -> Markup:
    study = diagnosis.study
    kinds = " and ".join(f"{n} {kind}" for kind, n in Counter(t.kind for t in study.trials).items())
    trials = "trial" if len(study.trials) == 1 else "trials"
    seconds = sum(t.duration for t in study.trials)
    partly = " partly" if diagnosis.causes and diagnosis.remainder.unexplained else ""
    return element(
        "header",
        element("p", f"{study.name} · rig {study.rig} · {kinds} {trials}, {seconds:.4g} s", class_="eyebrow"),
        element("h1", title(diagnosis), class_=f"verdict {diagnosis.verdict}{partly}"),
        answers(diagnosis),
        *(element("p", element("strong", "Warning: "), f"{words}.") for words in diagnosis.warnings),
    )


def _errors(diagnosis: Diagnosis) -> list[Markup]:
    """Errors of both models, in sample and held out; of a driven rig over three spans of time."""
    both, rows = bool(diagnosis.causes), _error_rows(diagnosis)
    head = ["trials", "prediction", "E nominal"] + ["E extended"] * both
    out = [element("p", E_WORDS), html_table(head, [r[: len(head)] for r in rows], (2, 3))]
    floor = f"The noise of the readings alone is {percent(diagnosis.ceiling_percent)} of E: no model can be better."
    notes = [floor, f"Held out: {diagnosis.held_out_by}."]
    ahead = diagnosis.ahead
    if ahead is not None:
        spans = (
            "One sample ahead any model is right where sampling is fast; free, a rig whose effort answers what is read "
            "drifts away with the best of models. What counts is the horizon between."
        )
        notes.append(spans)
        if diagnosis.is_driven and ahead.extended.free is None:
            notes.append("This rig falls over by itself: its free error is meaningless, and is not given.")
        unit = diagnosis.model.rig.units().get("effort", "")
        notes += [
            f"A random {r.name} of {r.std:.3g} {unit} acts all the time: {100.0 * r.share:.2g} % of what drives the "
            f"rig, changing within {r.time_constant_s:.2g} s."
            for r in diagnosis.random
        ]
    if diagnosis.left_out:
        count = sum(len(k) for columns in diagnosis.left_out.values() for k in columns.values())
        notes.append(
            f"{count} samples were left out as spikes: {left_out_text(diagnosis.left_out, diagnosis.study.trials)}."
        )
    for where, names in diagnosis.catalogue.origins().items():
        notes.append(f"Looked for as well: {', '.join(names)}, code of {Path(where).name}.")
    return [*out, *(element("p", words, class_="soft") for words in notes)]


def _error_rows(diagnosis: Diagnosis) -> list[list[Content]]:
    ahead = diagnosis.ahead
    if ahead is None:
        pairs = zip(("fitted", "held out"), diagnosis.nominal_error, diagnosis.extended_error, strict=True)
        return [[where, FREE, percent(b), percent(a)] for where, b, a in pairs if b is not None]
    rows: list[list[Content]] = []
    for where, before, after in (
        ("fitted", ahead.nominal, ahead.extended),
        ("held out", ahead.nominal_held_out, ahead.extended_held_out),
    ):
        if before is not None and after is not None:
            rows += [[where, what, old, new] for what, old, new in _spans(ahead.horizon_s, before, after)]
    return rows


def _spans(horizon_s: float, before: Ahead, after: Ahead) -> list[tuple[str, str, str]]:
    def free(value: float | None) -> str:
        return "meaningless: it falls" if value is None else percent(value)

    return [
        (ONE_STEP, percent(before.one_step), percent(after.one_step)),
        (f"{horizon_s:g} s ahead", percent(before.horizon), percent(after.horizon)),
        (FREE, free(before.free), free(after.free)),
    ]


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
        why = "what the nominal parameters take up, or no input of these trials drives."
        out.append(element("p", f"Not testable here, which is not the same as absent: {why}"))
        unseen = [diagnosis.catalogue.effect(n) for n in diagnosis.absorbed]
        rows: list[list[Content]] = [[element("code", e.name), stage_mark(str(e.stage)), sentence(e)] for e in unseen]
        out.append(html_table(("cause", "stage", "what it is"), rows, prose=True))
    else:
        out.append(
            element(
                "p",
                f"Every {'other ' if diagnosis.causes else ''}cause in the library could be seen in these data.",
                class_="soft",
            )
        )
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
        drawn = stimulus_drawing(plan.trial, position_unit(diagnosis))
        out.append(figure(drawn, "Inputs of the next trial.", "narrow", "next_trial"))
    return out


def _parameters(diagnosis: Diagnosis) -> list[Markup]:
    fits = [diagnosis.nominal, diagnosis.extended] if diagnosis.causes else [diagnosis.nominal]
    info = diagnosis.model.parameter_info()
    rows: list[list[Content]] = []
    for name in fits[-1].free:
        start = f"{diagnosis.study.start[name]:.4g}" if name in diagnosis.study.start else "-"
        cells = [value_and_interval(ParameterEstimate.of(f, name, "")) if name in f.free else ("-", "-") for f in fits]
        rows.append(
            [element("code", name), unit_text(info[name].unit), start, *(text for pair in cells for text in pair)]
        )
    head = ("parameter", "unit", "start", "nominal", "95 % interval", "extended", "95 % interval")
    unit = position_unit(diagnosis)
    noise: list[list[Content]] = [
        [element("code", n), f"{m.std:.3g}", unit_of(n, unit) or "-", str(len(m.ar)) if m.ar else "white"]
        for n, m in diagnosis.extended.noise.items()
    ]
    return [
        html_table(head[: 3 + 2 * len(fits)], rows, range(2, 7)),
        html_table(("noise of", "standard deviation", "unit", "autoregressive order"), noise, (1,)),
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
    python = _in_python(library, logged=diagnosis.log != Log())
    return [
        element("p", "The file ", element("code", "model.toml"), words),
        element("pre", "\n".join(lines)),
        element("pre", python),
    ]


def _in_python(library: str, *, logged: bool) -> str:
    """How a trial is predicted; `logged` says that its log must be undone before."""
    given = 'load_log("model.toml").applied(trial)' if logged else "trial"
    lines = ["import fes_pin as fp", *["from fes_pin.identify.stored import load_log"] * logged, ""]
    return "\n".join(
        [*lines, f'model = fp.load_model("model.toml"{library})', f"predicted = fp.predict(model, {given})"]
    )


def _provenance(diagnosis: Diagnosis) -> list[Markup]:
    made = diagnosis.provenance
    if made is None:
        return []
    rows: list[list[Content]] = [["made", made.date], ["seed", str(made.seed)]]
    if made.command:
        rows.append(["command", element("code", made.command)])
    rows.append(["versions", ", ".join(f"{n} {v}" for n, v in made.versions.items())])
    files: list[list[Content]] = [[element("code", n), element("code", digest)] for n, digest in made.inputs.items()]
    out = [element("div", html_table(("what", "value"), rows, prose=True), class_="provenance")]
    if files:
        hashes = element("div", html_table(("file of the study", "SHA-256"), files, prose=True), class_="provenance")
        out.append(folded(f"Hashes of the {len(files)} files that were read", hashes))
    return out
