"""The report of a result: one page of sections, the same for every front end, and what each front end adds."""

import math
import re
from dataclasses import replace
from importlib import import_module
from pathlib import Path

from fes_pin.data.numbers import instance
from fes_pin.data.outputs import HTML, written_by
from fes_pin.data.results import Result
from fes_pin.identify.error_measures import E_WORDS
from fes_pin.infer.result import ABSENT, ON, Cause, Change, Named, ParameterEstimate
from fes_pin.infer.text import percent, probability
from fes_pin.models.describe import equation, remark, sentence
from fes_pin.view.mathml import equations_mathml
from fes_pin.view.page import Content, Markup, document, element, figure, folded, html_table, section, unit_text
from fes_pin.view.plots import intervals_drawing, rivals_drawing
from fes_pin.view.sections import Parts, header, provenance_parts, stage_mark, value_and_interval

OWN = {"Diagnosis": "report_rig", "WalkDiagnosis": "report_walk", "Contrast": "report_groups"}
"""Modules that hold what each front end adds, as `PARTS`."""
STYLES = {"nothing_changed": "adequate", "changed": "causes_found"}
"""Verdicts that look like others."""
RIVALS = 7
"""Rivals shown of each cause."""


def report(result: Result, path: str | Path, *, overwrite: bool = False) -> None:
    """Write the report of a result of `diagnose` or `contrast`, whole or not at all.

    Parameters
    ----------
    path
        Of the page, `.html`.
    overwrite
        Replace a file that this function did not write, or that was changed since.

    Raises
    ------
    InputError
        It is no such result; or the file cannot be written, was read, or is one of others.
    """
    page = report_html(instance(result, Result, "diagnosis"))
    written_by("report", path, page, HTML, overwrite)


def answer_files(result: Result) -> dict[str, str | bytes]:
    """Content of every file of an answer by name: its record, its model, its report and what else there is to see."""
    further = {name: make(result) for name, make in _own(result).files.items()}
    return {**result.files(), "report.html": report_html(result), **further}


def _own(result: Result) -> Parts:
    """Sections of its front end."""
    own: Parts = import_module(f"fes_pin.view.{OWN[type(result).__name__]}").PARTS
    return own


def report_html(result: Result) -> str:
    """The report as one HTML page that needs nothing else: no network."""
    own = _own(result)
    names = f"{type(result).KIND.__name__}s"
    parts = [
        _header(result, own.counts(result), own.shown),
        section("Errors", *_errors(result)),
        section(names, *_named(result)),
        *own.sections(result),
        section("Why these, and no others", *_why(result)),
        section("Where this comes from", *provenance_parts(result.provenance)),
    ]
    return document(f"{result.study.name} - {result.FILE.removesuffix('.json')}", parts, own.residual)


def _header(result: Result, counts: str, elsewhere: tuple[str, ...]) -> Markup:
    """The verdict, and the questions that a reader has, each with its answer."""
    partly = " partly" if result.causes and result.remainder.unexplained else ""
    style = f"{STYLES.get(result.verdict, result.verdict)}{partly}"
    rows: list[tuple[Content, Content]] = [(_heading(one), _answer(result, one)) for one in result.causes]
    further = [("explained", str(result.explained))] if result.explained and result.causes else []
    further += [note for note in result.notes() if not note[0].startswith(elsewhere)]
    rows += [(element("span", _upper(topic)), said) for topic, said in further]
    return header(f"{result.study.name} · rig {result.study.rig} · {counts}", _upper(result.title()), style, rows)


def _heading(one: Named) -> Markup:
    stage = getattr(one, "stage", "")
    return element("code", one.name) + Markup(" ") + (stage_mark(stage) if stage else Markup(""))


def _answer(result: Result, one: Named) -> Content:
    """Return a sentence on a cause or change: what it is, its size and its significance."""
    kind = result.effect(one.name)
    what = one.words or one.sentence or (sentence(kind) if kind else one.name)
    where = f" At {one.site}." if one.site else ""
    return f"{_upper(what).removesuffix('.')}.{where} Size: {', '.join(_sizes(one))}. {distinguished(one)}"


def _sizes(one: Named) -> list[str]:
    """Its values in words, without units in their names, and without groups that do not have it."""
    sizes = []
    for (name, *group), estimate in one.estimates():
        if estimate.std != 0.0 or not group:
            sizes.append(
                " ".join([one.label(name, estimate), *group, str(replace(estimate, unit=unit_text(estimate.unit)))])
            )
    return sizes


def _upper(words: str) -> str:
    return words[:1].upper() + words[1:]


def distinguished(one: Named) -> str:
    """The family-wise error of a cause or change, and the candidates that are equivalent to it."""
    kind = type(one).__name__.lower()
    found = f"{kind} from {', '.join(one.equivalents) or f'every other {kind} in the library'}"
    data = f"cannot distinguish this {found}: read them as one set" if one.equivalents else f"distinguish this {found}"
    return f"By chance alone over the whole library: {probability(one.p_value)}. These data {data}."


def _errors(result: Result) -> list[Markup]:
    """Errors of both models, in sample and held out."""
    head = ["error E of", "data", "E nominal"] + ["E extended"] * bool(result.causes)
    rows = [[one.what, ON[one.on], percent(one.nominal), percent(one.extended)] for one in result.errors()]
    return [element("p", E_WORDS), html_table(head, [r[: len(head)] for r in rows], (2, 3))] if rows else []


AFTER_INTERVAL = r"(?<=\] )[^,\n]*"
"""The unit of an estimate in a cell of the table."""


def _named(result: Result) -> list[Markup]:
    """Return the named causes or changes: a table, their gains, and a card for each."""
    if not result.causes:
        open_ = "; the search ended before it had tried all" if result.is_stopped else ""
        return [element("p", f"None is named{open_}.")]
    _, head, rows, _ = result.as_table()
    gains = [(c.name, c.gain_held_out, c.stage) for c in result.causes if isinstance(c, Cause)]
    cells = [[re.sub(AFTER_INTERVAL, lambda unit: unit_text(unit[0]), cell) for cell in row[1:]] for row in rows]
    table = html_table(head, [[element("code", row[0]), *own] for row, own in zip(rows, cells, strict=True)])
    cards = [_card(result, one) for one in result.causes]
    if not gains:
        return [table, *cards]
    drawn = intervals_drawing([(n, g.percent, g.low, g.high, s) for n, g, s in gains], f"{head[3]} (%)", (0.0, 100.0))
    caption = "Lost without a cause, with the 95 % interval: percent of the nominal squared error above the noise."
    return [table, figure(drawn, caption, "narrow", "gains"), *cards]


def _card(result: Result, one: Named) -> Markup:
    """Return the card of a cause or a change, in a frame in the colour of its stage."""
    kind, stage = result.effect(one.name), getattr(one, "stage", "")
    rows: list[list[Content]] = [
        [element("code", one.label(n, estimate)), *(element("code", g) for g in group), *_value(one, estimate)]
        for (n, *group), estimate in one.estimates()
    ]
    told = element("p", f"Tell-tale: {remark(kind, 'Tell-tale:')}") if kind else Markup("")
    about = [equations_mathml(one.equation or equation(kind)), told] if kind else []
    table = html_table((*one.CELL, "value", "unit", "95 % interval"), rows, (len(one.CELL), len(one.CELL) + 2))
    drawn = [table, _by_group(one) if isinstance(one, Change) else _rivals(result, one)]
    return element("article", element("div", element("h3", _heading(one)), *about, *drawn), class_=f"cause {stage}")


def _value(one: Named, estimate: ParameterEstimate) -> tuple[str, str, str]:
    """Return value, unit and interval; of a change where a group does not have it, that it is absent."""
    is_absent = isinstance(one, Change) and estimate.std == 0.0
    return (ABSENT, "", "-") if is_absent else value_and_interval(estimate)


def _why(result: Result) -> list[Markup]:
    """How the answer was reached, and why each other candidate is not named."""
    if (why := result.why) is None:
        return []
    said = f"Estimator: {why.estimator}. A cause is named at a family-wise level of {why.level:g}. "
    said += f"What changed the answer of the search: {'; '.join(map(str, why.steps)) or 'nothing'}."
    if why.further:
        said += f" By its score the most significant further cause of the answer has {probability(why.further)}."
    rejected: list[list[Content]] = [
        [element("code", n), one.reason, probability(one.p_value)] for n, one in why.rejected.items()
    ]
    tried: list[list[Content]] = [[element("code", n), *one.cells()] for n, one in why.tried.items()]
    head = ("candidate", "nearest fitted set", "twice the log-likelihood, against the answer", "p")
    parts = [html_table(("rejected", "why", "p"), rejected, prose=True)] if rejected else []
    doubted: list[list[Content]] = [[element("code", one.name), str(one)] for one in why.corrections]
    parts += [html_table(("fault of the record", "test"), doubted, prose=True)] if doubted else []
    return [element("p", said), *parts, folded(f"{len(tried)} other candidates", html_table(head, tried, (2, 3)))]


def _by_group(change: Change) -> Markup:
    """The first parameter of a change in each group."""
    name, groups = next(iter(change.parameters.items()))
    rows = [(g, e.value, *e.interval, "") for g, e in groups.items()]
    unit = unit_text(next(iter(groups.values())).unit)
    name = change.label(name, groups[change.group])
    drawn = intervals_drawing(rows, f"{name} ({unit})" if unit else name)
    return figure(drawn, f"{name} in each group.", "narrow", change.name)


def _rivals(result: Result, cause: Named) -> Markup:
    """The nearest rivals that would stand in the place of one cause."""
    others, found = {c.name for c in result.causes} - {cause.name}, dict[str, float]()
    for one in getattr(result, "ranking", {}).get(cause.name, ()):
        instead = sorted(set(one.names) - others)
        if instead and instead != [cause.name]:
            found[" + ".join(instead)] = min(one.shortfall, found.get(" + ".join(instead), math.inf))
    if not found:
        return Markup("")
    near = sorted(found.items(), key=lambda pair: pair[1])[:RIVALS]
    rows = [(n, v, str(getattr(result.effect(n.partition(" + ")[0]), "stage", ""))) for n, v in near]
    caption = (
        f"Rivals in place of {cause.name}: by how much twice the log-likelihood of the whole fit falls. Hollow: "
        "equivalent; the grey band is what chance alone makes. Colours are the stages of the signal path."
    )
    return figure(rivals_drawing(cause, rows), caption, "narrow", f"rivals_{cause.name}")
