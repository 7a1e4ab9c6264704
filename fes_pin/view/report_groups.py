"""Sections of the report of a contrast: parameters and causes that did not change."""

from fes_pin.contrasts.result import Contrast
from fes_pin.view.page import Content, Markup, element, html_table, section, unit_text
from fes_pin.view.sections import Parts


def _counts(found: Contrast) -> str:
    """Return the number of trials of each group, in words."""
    return ", ".join(f"{g}: {sum(t.group == g for t in found.study.trials)} trials" for g in found.groups)


def _sections(found: Contrast) -> list[Markup]:
    """Its own sections."""
    rows: list[list[Content]] = [[element("code", n), f"{100.0 * v:.2g} %"] for n, v in found.unchanged.items()]
    rows += [[element("code", n), f"{p.value:.2g} {unit_text(p.unit)}"] for n, p in found.excluded.items()]
    said = (
        "A change of these parameters by more than a share of their value, and a cause that came with more than a "
        "size, would have been seen in 95 of 100 studies."
    )
    table = html_table(("parameter or cause", "at most"), rows, (1,))
    return [section("What did not change", element("p", said), table)] if rows else []


PARTS = Parts(_counts, _sections, ("did not change", "did not come"))
