"""Sections of the report of a rig: missing torque, trials, parameters, the model."""

from collections import Counter
from pathlib import Path

from fes_pin.data.log import Log
from fes_pin.data.results import NEXT_FILE
from fes_pin.diagnosis.replay import replayed_trials
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.infer.result import ParameterEstimate
from fes_pin.models.outside import origin
from fes_pin.view.page import Content, Markup, element, figure, html_table, section, unit_text
from fes_pin.view.plots import MODELS, stimulus_drawing
from fes_pin.view.report_effort import effort_section
from fes_pin.view.report_trials import missing_section, position_unit, trials_section
from fes_pin.view.sections import Parts, not_testable, value_and_interval
from fes_pin.view.style import quantity


def _counts(diagnosis: Diagnosis) -> str:
    """Return the number of trials and their length, in words."""
    trials = diagnosis.study.trials
    kinds = " and ".join(f"{n} {kind}" for kind, n in Counter(t.kind for t in trials).items())
    return f"{kinds} trial{'s' * (len(trials) > 1)}, {sum(t.duration for t in trials):.4g} s"


def _sections(diagnosis: Diagnosis) -> list[Markup]:
    """Its own sections."""
    replays, span = replayed_trials(diagnosis), diagnosis.over_horizon
    ahead = f"Simulated: {span.horizon_s:g} s ahead of what was measured, for it is driven. " if span else ""
    why = "the nominal parameters take them up, or no input of these trials drives them"
    return [
        not_testable(diagnosis, diagnosis.absorbed, why),
        section("Next experiment", *_next(diagnosis)),
        section("Missing torque and force", *missing_section(diagnosis, replays)),
        section("Effort along the measured motion", *effort_section(diagnosis)),
        section("Trials", *trials_section(replays, MODELS, position_unit(diagnosis), ahead)),
        section("Parameters and noise", *_parameters(diagnosis)),
        section("The model, to be used", *_use(diagnosis)),
    ]


def _next(diagnosis: Diagnosis) -> list[Markup]:
    plan = diagnosis.next_experiment
    if plan is None or plan.trial is None:
        return []
    conditions = "".join(f", {n} = {v:g}" for n, v in plan.trial.conditions.items())
    said = element("p", f"A {plan.trial.kind} trial{conditions}; its inputs are in ", element("code", NEXT_FILE), ".")
    if not plan.trial.columns:
        return [said]
    drawn = stimulus_drawing(plan.trial, position_unit(diagnosis))
    return [said, figure(drawn, "Inputs of the next trial.", "narrow", "next_trial")]


def _parameters(diagnosis: Diagnosis) -> list[Markup]:
    fits = [diagnosis.nominal, diagnosis.extended] if diagnosis.causes else [diagnosis.nominal]
    info, start = diagnosis.model.parameter_info(), diagnosis.study.start
    rows: list[list[Content]] = []
    for name in fits[-1].free:
        cells = [
            value_and_interval(ParameterEstimate.of(f, name, ""))[::2] if name in f.free else ("-", "-") for f in fits
        ]
        begun = f"{start[name]:.4g}" if name in start else "-"
        texts = (text for pair in cells for text in pair)
        rows.append([element("code", name), unit_text(info[name].unit), begun, *texts])
    head = ("parameter", "unit", "start", "nominal", "95 % interval", "extended", "95 % interval")
    unit = position_unit(diagnosis)
    noise: list[list[Content]] = [
        [element("code", n), f"{m.std:.3g}", quantity(n, unit)[1] or "-", str(len(m.ar)) if m.ar else "white"]
        for n, m in diagnosis.extended.noise.items()
    ]
    kinds = html_table(("noise of", "standard deviation", "unit", "autoregressive order"), noise, (1,))
    return [html_table(head[: 3 + 2 * len(fits)], rows, range(2, 7)), kinds]


def _use(diagnosis: Diagnosis) -> list[Markup]:
    rig = diagnosis.model.rig
    libraries = sorted({Path(where).name for one in (rig, *diagnosis.model.effects) if (where := origin(type(one)))})
    options = "".join(f" --library {name}" for name in libraries)
    told = (f"fes-pin predict model.toml TRIAL.csv {one}{options} --out PREDICTED.csv" for one in rig.settings)
    lines = [line.replace("  ", " ") for line in told]
    columns = " and ".join(("time_s", *rig.input_columns(diagnosis.study.trials[0])))
    which = "extended" if diagnosis.causes else "fitted nominal"
    words = f"model.toml next to this page is the {which} model, whole. TRIAL.csv needs {columns}. {rig.begins}"
    library = f", library={libraries}".replace("'", '"') if libraries else ""
    logged = diagnosis.log != Log()  # corrected before the trial is predicted
    given = 'load_log("model.toml").applied(trial)' if logged else "trial"
    imports = ["import fes_pin as fp", *["from fes_pin.identify.stored import load_log"] * logged, ""]
    python = [*imports, f'model = fp.load_model("model.toml"{library})', f"predicted = fp.predict(model, {given})"]
    return [element("p", words), element("pre", "\n".join(lines)), element("pre", "\n".join(python))]


PARTS = Parts(_counts, _sections, ("not testable",))
