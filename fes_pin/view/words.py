"""The first screen of a report: what is wrong, how large, how sure, how much of the error it is, what to do."""

from __future__ import annotations

import math
import re
from dataclasses import replace

from fes_pin.diagnosis.recorded import NEXT_FILE
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.infer.result import FITTED, STOPPED, Cause
from fes_pin.infer.text import LEAST_P, percent, probability
from fes_pin.models.describe import sentence
from fes_pin.models.stage import Effect
from fes_pin.view.page import Content, Markup, element, joined, unit_text

UNIT_IN_NAME = re.compile(r"(?<=.)(_(nms|nm|us|s|hz|n|kg|rad))?(_per_(rad[23]?|s))?$")
"""What a parameter's name says of its unit, which stands beside the value: of a slide it is another."""


def plain(name: str) -> str:
    """The name of a cause as words."""
    return name.replace("_", " ")


def listed(names: list[str], last: str = "and") -> str:
    """Words in a row: a, b and c."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {last} {names[-1]}"


def title(diagnosis: Diagnosis) -> str:
    """The verdict as the heading of the page."""
    so_far = "Stopped: best set so far: " if diagnosis.verdict == STOPPED else ""
    if not diagnosis.causes:
        if diagnosis.verdict == "adequate":
            return "The model is adequate"
        if so_far:
            return f"{so_far}no cause"
        return "The model misses something that no known cause explains"
    lacks = [plain(c.name) for c in diagnosis.causes if c.trial is None]
    misread = [f"trial {c.trial} was not run as it states" for c in diagnosis.causes if c.trial is not None]
    said = listed([*misread, *([f"the model lacks {listed(lacks)}"] if lacks else [])])
    rest = " \N{EN DASH} and something more" if diagnosis.remainder.unexplained else ""
    return f"{so_far}{said}{rest}" if so_far else f"{said[0].upper()}{said[1:]}{rest}"


def answers(diagnosis: Diagnosis) -> Markup:
    """The questions that a reader has, each with its answer."""
    rows = _found(diagnosis) if diagnosis.causes else _nothing(diagnosis)
    rows.append(("What to do next", _next(diagnosis)))
    made = [element("div", element("dt", question), element("dd", answer)) for question, answer in rows]
    return element("dl", joined(made), class_="answers")


def _found(diagnosis: Diagnosis) -> list[tuple[str, Content]]:
    causes, many = diagnosis.causes, len(diagnosis.causes) > 1

    def each(tell: str) -> Content:
        told = {"what": _what, "size": _size, "sure": _sure}[tell]
        lines = [(element("b", plain(c.name), ": ") if many else Markup("")) + told(diagnosis, c) for c in causes]
        return joined([element("p", line) for line in lines])

    share = diagnosis.explained.above_noise
    return [
        ("What the model gets wrong", each("what")),
        ("How large it is", each("size")),
        ("How sure that is", each("sure")),
        ("How much of the error it explains", _explains(diagnosis, share)),
        ("What is left", _left(diagnosis, share)),
    ]


def _what(diagnosis: Diagnosis, cause: Cause) -> Markup:
    if cause.trial is not None:
        return _text(f"{cause.words[0].upper()}{cause.words[1:]}.")
    kind: type[Effect] = diagnosis.catalogue.effect(cause.name)
    return _text(f"{sentence(kind)} It acts at the {cause.stage}.")


def _size(diagnosis: Diagnosis, cause: Cause) -> Markup:
    """Values with their standard deviations; the first parameter is what gives the cause its size."""
    told = []
    for name, one in cause.parameters.items():
        said = str(replace(one, unit=unit_text(one.unit) if one.unit else "")).replace("+-", "±")
        told.append(f"{plain(_without_unit(name))} {said}")
    return _text(", ".join(told) + (" (± one standard deviation)." if any("±" in one for one in told) else "."))


def _without_unit(name: str) -> str:
    return UNIT_IN_NAME.sub("", name)


def _sure(diagnosis: Diagnosis, cause: Cause) -> Markup:
    chance = (
        "Chance alone makes a cause look so strong in fewer than one study in 10¹²"
        if cause.p_value < LEAST_P
        else f"Chance alone makes a cause look so strong in {_one_in(cause.p_value)}"
    )
    if cause.equivalents:
        others = listed([plain(n) for n in cause.equivalents], "or")
        return _text(
            f"That it is there: {chance[0].lower()}{chance[1:]}. Which it is: these data cannot tell it from {others}."
        )
    return _text(f"{chance}, and these data tell it apart from every other cause that was looked for.")


def _one_in(p_value: float) -> str:
    if not math.isfinite(p_value) or p_value > 0.5:
        return "every second study"
    return f"one study in {_round(1.0 / p_value)}"


def _round(count: float) -> str:
    """A large number to two digits, or to one power of ten: 24, 310, 3 x 10^7."""
    if count < 1e4:
        return f"{count:.2g}" if count < 100 else f"{round(count, 1 - math.floor(math.log10(count))):.0f}"
    digit, _, power = f"{count:.0e}".partition("e+")
    exponent = str(int(power)).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"10{exponent}" if digit == "1" else f"{digit} × 10{exponent}"


def _explains(diagnosis: Diagnosis, share: float) -> str:
    what = "it" if len(diagnosis.causes) == 1 else "they"
    ends = "s" if what == "it" else ""
    found = diagnosis.explained
    before, after, noise = found.nominal, found.extended, found.noise
    where = "trials that took no part in finding it" if found.on != FITTED else "the trials that it was fitted to"
    if diagnosis.over_horizon is not None:
        return (
            f"{share:.0f} % of what is not noise. Predicting {diagnosis.over_horizon.horizon_s:g} s ahead, the error E "
            f"falls from {percent(before)} to {percent(after)}, on {where}{_noise_alone(noise)}."
        )
    return (
        f"{share:.0f} % of what is not noise, on {where}: {what} take{ends} the error E from {percent(before)} to "
        f"{percent(after)}{_noise_alone(noise)}."
    )


def _noise_alone(noise: float | None) -> str:
    return "" if noise is None else f"; the noise alone is {percent(noise)}"


def _left(diagnosis: Diagnosis, share: float) -> str:
    left = diagnosis.remainder
    stays = f"{100.0 - share:.0f} % of the error stays. " if share < 99.5 else ""
    if diagnosis.reason is not None and left.unexplained:
        return f"{stays}Something is still unexplained: {diagnosis.reason}."
    if not left.unexplained:
        return f"{stays}What stays looks like noise ({probability(left.p_value)})."
    where = f"; it depends most on {left.where}" if left.where else ""
    return f"{stays}What stays is not noise ({probability(left.p_value)}){where}."


def _nothing(diagnosis: Diagnosis) -> list[tuple[str, Content]]:
    left, count = diagnosis.remainder, len(diagnosis.catalogue.effects_for(diagnosis.model.rig))
    error, noise = diagnosis.explained.nominal, diagnosis.explained.noise
    span = "" if diagnosis.over_horizon is None else f", {diagnosis.over_horizon.horizon_s:g} s ahead"
    size = f"E is {percent(error)}{span}{_noise_alone(noise)}"
    if diagnosis.verdict == "adequate":
        unseen = diagnosis.absorbed
        hidden = f" {len(unseen)} of them could not show in these data: see below." if unseen else ""
        return [
            ("What the model gets wrong", f"Nothing that these data show. {count} causes were looked for.{hidden}"),
            ("How large its error is", f"{size}."),
            ("How sure that is", f"What the model leaves looks like noise ({probability(left.p_value)})."),
        ]
    why = diagnosis.reason or (
        "the search ended before it had tried every cause; nothing is claimed of those that it did not try"
        if diagnosis.verdict == STOPPED
        else "something is there, and none of the causes in the library explains it"
    )
    where = f" It depends most on {left.where}." if left.where else ""
    return [
        ("What the model gets wrong", f"{why[0].upper()}{why[1:]}. {count} causes were looked for.{where}"),
        ("How large its error is", f"{size}."),
        ("How sure that is", _certain(left.p_value)),
    ]


def _certain(p_value: float) -> str:
    if math.isnan(p_value):
        return "It was not tested: no fit carries a verdict."
    often = "fewer than one study in 10¹²" if p_value < LEAST_P else _one_in(p_value)
    return f"Noise alone leaves as much in {often}."


NEXT = {
    STOPPED: "Diagnose again without a limit of time, or with a longer one, before you use this answer.",
    "adequate": "Keep the model. To look for causes that these trials cannot show, record other ones.",
}
"""What to do next, by verdicts that alone decide it."""


def _next(diagnosis: Diagnosis) -> Content:
    if diagnosis.verdict in NEXT:
        return NEXT[diagnosis.verdict]
    plan = diagnosis.next_experiment
    if plan is not None and diagnosis.causes:
        pair = listed([plain(n) for n in plan.separates])
        if plan.trial is not None:
            return Markup("") + element(
                "span", "Run the trial in ", element("code", NEXT_FILE), f": it separates {pair}."
            )
        return f"To separate {pair}: {plan.why}."
    if diagnosis.causes and not diagnosis.remainder.unexplained:
        return element(
            "span",
            "Use the extended model, ",
            element("code", "model.toml"),
            ": simulate, predict and control with it.",
        )
    if diagnosis.causes:
        return "Use the extended model with care, and look at what is left: the missing torque shows what it follows."
    return (
        "Look at the missing torque below, most telling variable first; check sensors and conditions of the trials "
        "that are missed most; write the cause that you suspect as one of your own, and diagnose again."
    )


def _text(words: str) -> Markup:
    return element("span", words)
