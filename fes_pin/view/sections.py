"""Parts of pages that several of them show."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from fes_pin.data.provenance import Provenance
from fes_pin.data.results import Result
from fes_pin.infer.result import ParameterEstimate
from fes_pin.infer.text import estimated
from fes_pin.models.describe import sentence
from fes_pin.view.page import Content, Markup, element, folded, html_table, joined, section, unit_text


@dataclass(frozen=True)
class Parts:
    """Sections that a front end adds to the page of its results.

    Attributes
    ----------
    counts
        What was measured, in a few words.
    sections
        Its own sections.
    shown
        Beginnings of the topics of notes that these show.
    files
        Further files of the answer, by name.
    residual
        What a residual is.
    """

    counts: Callable[[Any], str]
    sections: Callable[[Any], list[Markup]]
    shown: tuple[str, ...]
    files: Mapping[str, Callable[[Any], str]] = field(default_factory=dict)
    residual: str = "Residual = measured - simulated. "


def header(eyebrow: str, title: str, verdict: str, rows: Sequence[tuple[Content, Content]]) -> Markup:
    """The head of a page: a title in the style of a verdict, and questions, or topics, with what is said of them."""
    small, large = element("p", eyebrow, class_="eyebrow"), element("h1", title, class_=f"verdict {verdict}")
    answers = [element("div", element("dt", question), element("dd", answer)) for question, answer in rows]
    return element("header", small, large, element("dl", joined(answers), class_="answers"))


def stage_mark(stage: str) -> Markup:
    """A stage of the signal path, in its colour."""
    return element("span", stage, class_=f"stage {stage}")


def value_and_interval(one: ParameterEstimate) -> tuple[str, str, str]:
    """Value, unit and interval of a parameter as printed."""
    unit = unit_text(one.unit)
    if one.at_bound:
        return f"{one.value:.4g}", unit, f"{one.one_sided()}, at its bound"
    value, reach = estimated(one.value, one.std, one.interval)
    return value, unit, reach


def not_testable(result: Result, names: Sequence[str], why: str) -> Markup:
    """A section of the causes that these data could not show, with what each is."""
    rows: list[list[Content]] = [
        [element("code", n), sentence(e)] for n in names if (e := result.effect(n)) is not None
    ]
    said = element("p", f"Not testable is not the same as absent: {why}.")
    table = html_table(("cause", "what it is"), rows, prose=True)
    return section("Not testable here", *([said, table] if rows else []))


def provenance_parts(made: Provenance | None) -> list[Markup]:
    """When it was made, by which versions, from which files."""
    if made is None:
        return []
    rows: list[list[Content]] = [["made", made.date], ["seed", str(made.seed)]]
    rows += [["command", element("code", made.command)]] if made.command else []
    rows.append(["versions", ", ".join(f"{n} {v}" for n, v in made.versions.items())])
    files: list[list[Content]] = [[element("code", n), element("code", digest)] for n, digest in made.inputs.items()]
    out = [element("div", html_table(("what", "value"), rows, prose=True), class_="provenance")]
    if files:
        hashes = element("div", html_table(("file of the study", "SHA-256"), files, prose=True), class_="provenance")
        out.append(folded(f"Hashes of the {len(files)} files that were read", hashes))
    return out
