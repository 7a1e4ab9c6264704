"""The part of the report that names the causes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from fes_pin.diagnosis.result import EACH_TRIAL, Diagnosis
from fes_pin.infer.result import STOPPED, Cause, ParameterEstimate
from fes_pin.infer.text import probability
from fes_pin.models.describe import equation, remark, sentence
from fes_pin.view.mathml import equations_mathml
from fes_pin.view.page import Content, Markup, element, figure, html_table, unit_text, value_text
from fes_pin.view.ranking import gain_drawing, rivals_drawing, shown_rivals


def stage_mark(stage: str) -> Markup:
    """A stage of the signal path, in its colour."""
    return element("span", stage, class_=f"stage {stage}")


def causes_section(diagnosis: Diagnosis) -> list[Markup]:
    """The causes: a table, their gains, and a card for each."""
    if not diagnosis.causes and diagnosis.verdict == STOPPED:
        return [element("p", "None is named so far: the search ended before every cause was tried.")]
    if not diagnosis.causes:
        return [element("p", "None is named: no cause in the library earned its place on these data.")]
    rows: list[list[Content]] = [
        [
            element("code", c.name),
            stage_mark(c.stage),
            str(c.gain_held_out),
            probability(c.p_value).removeprefix("p = ").removeprefix("p "),
            ", ".join(c.equivalents) or "-",
        ]
        for c in diagnosis.causes
    ]
    held_out = any(c.gain_held_out.is_held_out for c in diagnosis.causes)
    on = "held-out trials" if held_out else "the trials that were fitted, as none could be held out,"
    caption = f"Gain on {on} with its 95 % interval: percent of the nominal model's squared error above noise."
    return [
        html_table(("cause", "stage", f"{diagnosis.head()[3]} [95 %]", "p", "cannot be told from"), rows, (2, 3)),
        figure(gain_drawing(diagnosis), caption, "narrow", "gains"),
        *(_cause(diagnosis, c) for c in diagnosis.causes),
    ]


def _rivals(diagnosis: Diagnosis, cause: Cause) -> Markup:
    if not shown_rivals(diagnosis, cause):
        return Markup("")
    caption = (
        f"Rivals in place of {cause.name}: by how much twice the log-likelihood of the whole fit falls. Hollow: not "
        "told apart; the grey band is what chance alone makes. Colours are the stages of the signal path."
    )
    return figure(rivals_drawing(diagnosis, cause), caption, "narrow", f"rivals_{cause.name}")


def _of_one_trial(diagnosis: Diagnosis, cause: Cause) -> Markup:
    """The card of a cause that concerns one trial, and is no part of the model."""
    gain = f"Restated, it removes {cause.gain_held_out} of that trial's error above the noise, told by its other parts."
    return card(
        element("h3", element("code", cause.name), " ", stage_mark(cause.stage)),
        element("p", f"{cause.words[0].upper()}{cause.words[1:]}."),
        _estimates(cause),
        element("p", gain, " Everything else here is told with that value in its place."),
        stage=cause.stage,
    )


def card(*contents: Markup, stage: str = "") -> Markup:
    """A frame about what is said of a cause or a change, in the colour of its stage."""
    return element("article", element("div", *contents), class_=f"cause {stage}".rstrip())


def _cause(diagnosis: Diagnosis, cause: Cause) -> Markup:
    if cause.trial is not None:
        return _of_one_trial(diagnosis, cause)
    kind = diagnosis.catalogue.effect(cause.name)
    told = told_apart(cause.equivalents, "cause")
    where = f"held-out trials ({cause.gain_fit:.0f} % on the fitted ones)"
    if not cause.gain_held_out.is_held_out:
        where = "the trials that were fitted: there was nothing to hold out"
    gain = f"It removes {cause.gain_held_out} of the error above the noise on {where}."
    return card(
        element("h3", element("code", cause.name), " ", stage_mark(cause.stage)),
        element("p", sentence(kind)),
        equations_mathml(equation(kind)),
        _estimates(cause),
        element("p", gain, " ", told, *_notes(diagnosis, cause)),
        element("p", f"Tell-tale: {remark(kind, 'Tell-tale:')}", class_="soft"),
        _rivals(diagnosis, cause),
        stage=cause.stage,
    )


def told_apart(equivalents: Sequence[str], what: str) -> str:
    """Whether the data tell a cause or a change apart from the others, in words."""
    if equivalents:
        return f"These data cannot tell it from {', '.join(equivalents)}: read them as one set."
    return f"These data tell it apart from every other {what} in the library."


def _notes(diagnosis: Diagnosis, cause: Cause) -> list[str]:
    """What is to be said where the amplitudes are each trial's own, or where some folds choose another cause."""
    own = any(e.each_trial for e in diagnosis.model.effects if e.name == cause.name)
    notes = [f" {EACH_TRIAL[0].upper()}{EACH_TRIAL[1:]}."] if own else []
    if some := cause.chosen_in_some:
        notes.append(f" It is chosen again in {some[0]} of {some[1]} folds, each without the trials it foretells.")
    return notes


def _estimates(cause: Cause) -> Markup:
    rows: list[list[Content]] = []
    for name, one in cause.parameters.items():
        shown, interval = value_and_interval(one)
        rows.append([element("code", name), shown, unit_text(one.unit), interval])
    return html_table(("parameter", "value", "unit", "95 % interval"), rows, (1, 3))


def value_and_interval(one: ParameterEstimate) -> tuple[str, str]:
    """Value and interval of a parameter as printed."""
    if one.at_bound:
        return f"{one.value:.4g}", f"{one.one_sided()}, at its bound"
    if one.std == 0.0:
        return f"{one.value:.4g}", "held"
    if not math.isfinite(one.std):
        return f"{one.value:.3g}", "not identified"
    low, high = (value_text(end, one.std) for end in one.interval)
    return value_text(one.value, one.std), f"[{low}, {high}]"
