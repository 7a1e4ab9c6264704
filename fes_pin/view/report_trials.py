"""The part of the report that shows the trials: curves, residuals, missing torque."""

from collections import Counter
from collections.abc import Collection, Sequence

from fes_pin.data.schema import IMPOSED
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.identify.replay import Replay
from fes_pin.models.rigs.joint import Joint
from fes_pin.view.missing import Missing, missing_input
from fes_pin.view.page import Markup, element, figure, folded, joined, key
from fes_pin.view.plots import Legend, errors_in_words, missing_drawing, share, trial_drawing

OPEN = 4
"""Trials that are drawn at once, those of largest errors; the others are folded."""
FLAG = element("strong", "worse", class_="worse")
WORSE = 0.01
"""Share by which a trial's error must grow to count as worse: less is the noise of one trial's fit."""


def position_unit(diagnosis: Diagnosis) -> str:
    """Unit of the joint's position: "m" for a prismatic one."""
    return diagnosis.model.rig.units()["q"]


def missing_section(diagnosis: Diagnosis, replays: Sequence[Replay]) -> list[Markup]:
    """Missing torque and force against every variable.

    Nothing of trials in which a controller moves a joint, whose free simulation would run away: see `report_effort`.
    """
    is_driven = diagnosis.over_horizon is not None and isinstance(diagnosis.model.rig, Joint)
    replays = [r for r in replays if r.measured.kind == IMPOSED or not is_driven]
    if not replays:
        return []
    before = _missing(diagnosis, replays, "nominal")
    after = _missing(diagnosis, replays, "extended") if diagnosis.causes else []
    unit = position_unit(diagnosis)
    text = (
        "What would have to be added to the model's torque (or force) at each instant to make it right: the smoothed "
        "residual, taken through the inertia, damping and stiffness of the rig. A cause shows as a function of what it "
        "depends on. Most telling variable first: the percentage is the share of the variance that is a function of "
        "that variable alone."
    )
    extended = [("extended", "extended, median")] if after else []
    out = [element("p", text)]
    out.append(key(("nominal", "nominal, instants"), ("measured", "nominal, median"), *extended))
    for kind in dict.fromkeys(one.kind for one in before):
        first, second = ([one for one in many if one.kind == kind] for many in (before, after))
        names = sorted(first[0].against, key=lambda n: -share(first, n))
        drawings = [(n, missing_drawing(first, second, n, unit)) for n in names]
        drawn = [figure(one, file=f"missing_{kind}_against_{n}") for n, one in drawings]
        out.append(element("h3", f"Missing {kind}, {len(first)} trial{'s' * (len(first) > 1)}"))
        out.append(element("div", joined(drawn), class_="grid three"))
    return out


def _missing(diagnosis: Diagnosis, replays: Sequence[Replay], which: str) -> list[Missing]:
    return [missing_input(diagnosis.model.rig, r.measured, r.models[which]) for r in replays]


def trials_section(replays: Sequence[Replay], legend: Legend, unit: str, said: str = "") -> list[Markup]:
    """A figure of each trial; those with small errors are folded.

    Parameters
    ----------
    replays
        The trials.
    legend
        As of `trial_drawing`.
    unit
        Of the joint's position.
    said
        How the models were simulated.
    """
    shown = _open(replays)

    def drawn(chosen: Collection[int]) -> Markup:
        made = {k: trial_drawing(replays[k], legend, unit) for k in sorted(chosen)}
        figures = [figure(one, _trial_caption(replays[k]), file=f"trial_{k + 1}") for k, one in made.items()]
        return element("div", joined(figures), class_="grid")

    text = (
        f"{said}Residual = measured - simulated, as it is (faint) and smoothed; its band is twice the standard "
        "deviation of the noise."
    )
    out = [element("p", text, class_="soft"), *_worse_note(replays), drawn(shown)]
    if others := set(range(len(replays))) - shown:
        few = f"the other {len(others)} trials" if len(others) > 1 else "the other trial"
        out.append(folded(f"Show {few}, with smaller errors", drawn(others)))
    return out


def _open(replays: Sequence[Replay]) -> set[int]:
    """Return the trials that are drawn at once: those that a model misses most, of each group in turn."""
    errors, seen, turn = [max(one.errors.values()) for one in replays], Counter[str | None](), dict[int, int]()
    for k in sorted(range(len(replays)), key=lambda k: -errors[k]):
        turn[k] = seen[replays[k].measured.group]
        seen[replays[k].measured.group] += 1
    return set(sorted(turn, key=lambda k: (turn[k], -errors[k]))[:OPEN])


def got_worse(one: Replay) -> bool:
    """True if the extended model misses a trial by more than the nominal one, and by more than noise makes it."""
    errors = one.errors
    return "extended" in errors and errors["extended"] > (1.0 + WORSE) * errors["nominal"]


def _worse_note(replays: Sequence[Replay]) -> list[Markup]:
    worse = [r.measured.name for r in replays if got_worse(r)]
    which = f"{len(worse)} of {len(replays)} trials" if len(worse) > 1 else "One trial"
    return [element("p", FLAG, f" {which} got worse with the extended model: {', '.join(worse)}.")] if worse else []


def _trial_caption(one: Replay) -> Markup:
    trial = one.measured
    conditions = "".join(f", {n} = {v:g}" for n, v in trial.conditions.items())
    held_out = ", held out" if trial.role == "held_out" else ""
    said = f" \u00b7 {trial.kind}{conditions}{held_out}, {trial.duration:.4g} s \u00b7 E {errors_in_words(one)} "
    return element("strong", trial.name) + element("span", said) + (FLAG if got_worse(one) else Markup(""))
