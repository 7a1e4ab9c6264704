"""Sections of the report of a contrast: its trials with the models of its groups, and what did not change."""

from fes_pin.contrasts.replay import EVERY, horizon_of
from fes_pin.contrasts.result import Contrast
from fes_pin.view.page import Content, Markup, element, html_table, section, unit_text
from fes_pin.view.plots import MEASURED, Legend
from fes_pin.view.report_trials import trials_section
from fes_pin.view.sections import Parts

COLOURS_OF_GROUPS = ("nominal", "extended", "stage-muscle", "stage-joint", "stage-sensor")
"""Colours of the models of the groups, in their order."""


def _counts(found: Contrast) -> str:
    """Return the number of trials of each group, in words."""
    counts = {g: sum(t.group == g for t in found.study.trials) for g in found.groups}
    return ", ".join(f"{g}: {n} trial{'s' * (n > 1)}" for g, n in counts.items())


def _legend(found: Contrast) -> Legend:
    """Return the colour and the words of the model of each group."""
    names = found.groups if found.fit.changes else (EVERY,)
    each = {g: COLOURS_OF_GROUPS[k % len(COLOURS_OF_GROUPS)] for k, g in enumerate(names)}
    return {**MEASURED, **{g: (colour, f"model of {g}") for g, colour in each.items()}}


def _sections(found: Contrast) -> list[Markup]:
    """Its own sections."""
    horizon_s = horizon_of(found.fit)
    ahead = f"Simulated: {horizon_s:g} s ahead of what was measured, for it is driven. " if horizon_s else ""
    unit = found.fit.grouped.rig.units()["q"]
    return [
        section("Trials", *trials_section(found.replays, _legend(found), unit, ahead)),
        section("What did not change", *_unchanged(found)),
    ]


def _unchanged(found: Contrast) -> list[Markup]:
    rows: list[list[Content]] = [[element("code", n), f"{100.0 * v:.2g} %"] for n, v in found.unchanged.items()]
    rows += [[element("code", n), f"{p.value:.2g} {unit_text(p.unit)}"] for n, p in found.excluded.items()]
    said = (
        "A change of these parameters by more than a share of their value, and a cause that came with more than a "
        "size, would have been seen in 95 of 100 studies."
    )
    return [element("p", said), html_table(("parameter or cause", "at most"), rows, (1,))] if rows else []


PARTS = Parts(_counts, _sections, ("did not change", "did not come"))
