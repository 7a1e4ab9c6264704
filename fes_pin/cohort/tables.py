"""A cohort as tables, and their page: a row a study, a row a parameter of a cause, a row a pooled value.

The page says which causes are in which studies, what is common to them, and links each study's own report.
"""

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from fes_pin.cohort.one import Kept
from fes_pin.cohort.pool import discovery_rates, pooled, share_interval
from fes_pin.data.provenance import Provenance, today, versions
from fes_pin.identify.error_measures import E_WORDS, MEASURES
from fes_pin.infer.levels import CONFIDENCE_95, UNUSUAL_LEVEL
from fes_pin.infer.text import listed, percent, probability, rounded
from fes_pin.view.drawing import Drawing
from fes_pin.view.page import Content, Markup, document, element, figure, folded, html_table, joined, section
from fes_pin.view.plots import HeatCell, heat_drawing, intervals_drawing
from fes_pin.view.sections import header, provenance_parts, stage_mark

Row = Mapping[str, Any]

ERRORS = {f"{model}_{n}_percent": (model, n) for model in ("nominal", "extended") for n in MEASURES}
"""Columns of errors E, by model and name in `diagnosis.json`: see `identify.error_measures`."""


def tables_of(kept: Iterable[Kept], candidates: int) -> dict[str, Sequence[Row]]:
    """Return the tables of a cohort, whose studies were each searched for so many candidates."""
    studies, causes, nominal = list[Row](), list[Row](), list[Row]()
    for one in kept:
        studies.append(study_row(one))
        causes += cause_rows(one)
        nominal += nominal_rows(one)
    good = sum(r["verdict"] != "failed" for r in studies)
    causes = with_rates(causes, good * candidates)
    pooled_too, prevalence = pooled_rows([*causes, *nominal], good), prevalence_rows(causes, good)
    return {"studies": studies, "causes": causes, "pooled": pooled_too, "prevalence": prevalence}


def study_row(one: Kept) -> Row:
    """Return the result of a study; its error if it failed, and None or NaN for values that were not computed."""
    found = one.record
    return {
        "study": one.name,
        "verdict": found.get("verdict", "failed"),
        "causes": " + ".join(c["name"] for c in found["causes"]) if found else None,
        "not_testable": " ".join(found.get("absorbed", ())) if found else None,
        "unexplained": found["remainder"]["unexplained"] if found else None,
        **{name: _number(found.get(model, {}).get("error_percent", {}).get(n)) for name, (model, n) in ERRORS.items()},
        "horizon_s": _number(found.get("horizon_s")),
        "ceiling_percent": _number(found.get("ceiling_percent")),
        "wall_s": _number(found.get("wall_s")),
        "error": one.error,
    }


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)


def cause_rows(one: Kept) -> Iterator[Row]:
    """Yield every parameter of every cause of a study."""
    for cause in one.record.get("causes", ()):
        gain = cause.get("gain_percent") or {}
        low, high = gain.get("ci95") or (None, None)
        for name, size in cause["parameters"].items():
            yield {
                "study": one.name,
                "cause": cause["name"],
                "stage": cause.get("stage", ""),
                "parameter": name,
                "value": _number(size["value"]),
                "std": _number(size["std"]),
                "low": _number(size.get("low")),
                "high": _number(size.get("high")),
                "p_value": _number(cause.get("p_value")),
                "gain_percent": _number(gain.get("held_out")),
                "gain_low": _number(low),
                "gain_high": _number(high),
                "equivalents": " ".join(cause.get("equivalents", ())),
            }


def with_rates(rows: Sequence[Row], tests: int) -> list[Row]:
    """Return the rows of causes with their false discovery rates; `tests` as `discovery_rates` takes them."""
    named = {(r["study"], r["cause"]): r["p_value"] for r in rows}
    rates = dict(zip(named, discovery_rates(list(named.values()), tests).tolist(), strict=True))
    return [{**r, "false_discovery_rate": rates[r["study"], r["cause"]]} for r in rows]


def nominal_rows(one: Kept) -> list[Row]:
    """Return every parameter of an extended model but those of its causes: what all studies have."""
    known = one.record.get("extended", {}).get("parameters", {})
    nominal = ((n, {k: _number(v[k]) for k in ("value", "std")}) for n, v in known.items() if "." not in n)
    return [{"cause": "", "parameter": name, **value} for name, value in nominal]


def by_parameter(rows: Iterable[Row]) -> dict[tuple[str, str], list[Row]]:
    """Return rows by cause and parameter."""
    groups: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in rows:
        groups[row["cause"], row["parameter"]].append(row)
    return groups


def pooled_rows(rows: Iterable[Row], studies: int) -> list[Row]:
    """Return pooled values of every parameter of causes, and nominal, that at least two studies have; causes first."""
    out: list[Row] = []
    for (cause, parameter), many in by_parameter(rows).items():
        found = pooled([r["value"] for r in many], [r["std"] for r in many])
        if found is not None:
            out.append({"cause": cause, "parameter": parameter, "of": studies, **found})
    return sorted(out, key=lambda r: (r["cause"] == "", r["cause"]))


def prevalence_rows(causes: Sequence[Row], studies: int) -> list[Row]:
    """In how many studies each cause was named, with the 95 % interval of its share; most frequent first."""
    named: dict[str, dict[str, Row]] = defaultdict(dict)
    for row in causes:
        named[row["cause"]][row["study"]] = row
    out: list[Row] = []
    for cause, rows in named.items():
        low, high = share_interval(len(rows), studies)
        gains = sorted(g for r in rows.values() if not math.isnan(g := r["gain_percent"]))  # one trial holds none out
        out.append(
            {
                "cause": cause,
                "stage": next(iter(rows.values()))["stage"],
                "studies": len(rows),
                "certain": sum(r["false_discovery_rate"] <= UNUSUAL_LEVEL for r in rows.values()),
                "share_percent": 100.0 * len(rows) / max(studies, 1),
                "share_low": low,
                "share_high": high,
                "median_gain_percent": gains[len(gains) // 2] if gains else math.nan,
                "alone": sum(not r["equivalents"] for r in rows.values()),
                "equivalents": " ".join(sorted({n for r in rows.values() for n in r["equivalents"].split()})),
            }
        )
    return sorted(out, key=lambda r: (-r["studies"], r["cause"]))


FOREST = 40
"""Studies of one forest plot; of more only the pooled value is drawn."""
MODELS = (
    "Of the nominal, then of the extended model, on trials held out where there are such. Free: from the inputs alone; "
    "ahead: each sample from what was measured up to the study's horizon before it. Of walking E is that of the ground "
    "reaction which the motion requires."
)
"""Words about the errors of studies."""


def cohort_html(tables: Mapping[str, Sequence[Row]], seed: int, command: str = "") -> str:
    """The page of the tables of a cohort, complete in one file; it links the reports that lie next to it."""
    studies, prevalence = tables["studies"], tables["prevalence"]
    good = [r for r in studies if r["verdict"] != "failed"]
    parts = [
        _head(studies, prevalence, tables["causes"]),
        section("Which causes, and in how many studies", *_prevalence(prevalence, len(good))),
        section("Studies by causes", *_by_cause(good, tables["causes"])),
        section("How large they are in the population", *_pooled(tables["causes"], tables["pooled"])),
        section("Studies", *_studies(studies)),
        section("Where this comes from", *provenance_parts(Provenance(today(), versions(), {}, seed, command))),
    ]
    return document("Cohort", parts)


def title_of(studies: Sequence[Row]) -> str:
    """Return the number of studies by verdict, in words."""
    counts = Counter(map(_verdict, studies))
    known = [f"{counts[word]} {word}" for word in VERDICTS.values() if counts[word]]
    return f"{len(studies)} stud{'y' if len(studies) == 1 else 'ies'}: {', '.join(known)}"


VERDICTS = {
    "causes_found": "explained",
    "partly": "partly explained",
    "adequate": "adequate",
    "unexplained": "unexplained",
    "stopped": "stopped",
    "failed": "failed",
}
"""Verdicts in words; "partly" is of a study with named causes and a lack of fit."""


def _verdict(row: Row) -> str:
    is_partly = row["verdict"] == "causes_found" and row["unexplained"]
    return VERDICTS["partly" if is_partly else row["verdict"]]


def named_in(row: Row, studies: int) -> str:
    """Return in how many studies a cause was named, and what it ties with there, in words."""
    tied = _tied(row)
    return f"{row['studies']} of {studies}" + (f" (ties with {tied})" if tied else "")


def _tied(row: Row) -> str:
    """Return the causes that data cannot distinguish from one, and in how many studies; "" for none."""
    tied = row["studies"] - row["alone"]
    return f"{listed(row['equivalents'].split())} in {tied}" if tied else ""


def advice_of(studies: Sequence[Row], causes: Sequence[Row]) -> str:
    """Return the next step, in words."""
    of: dict[str, list[str]] = defaultdict(list)
    for row in studies:
        of[_verdict(row)].append(row["study"])
    tied = sorted({r["study"] for r in causes if r["equivalents"]})
    steps = [
        ("correct the files of", of["failed"]),
        ("diagnose again with a longer limit of time", of["stopped"]),
        ("record the trial that separates equivalent causes in", tied),
        ("read which sensor or condition is missed most in the reports of", of["unexplained"] + of["partly explained"]),
    ]
    said = [f"{words} {_few(names)}" for words, names in steps if names]
    return "; ".join(said) or "use the model of each study: extended where a cause is named, nominal elsewhere"


FEW = 5
"""Studies that are listed in a sentence; of more their number stands there too."""


def _few(names: Sequence[str]) -> str:
    more = len(names) - FEW
    return listed([*names[:FEW], *([f"{more} more"] if more > 0 else [])])


def _head(studies: Sequence[Row], prevalence: Sequence[Row], causes: Sequence[Row]) -> Markup:
    good = sum(r["verdict"] != "failed" for r in studies)
    most = [r for r in prevalence if r["studies"] == prevalence[0]["studies"]]
    each = [f"{r['cause'].replace('_', ' ')} in {named_in(r, good)}" for r in most[:FEW]]
    more = f"; {len(most) - FEW} more as often" if len(most) > FEW else ""
    rows: list[tuple[Content, Content]] = [("Named most often", "; ".join(each) + more)] if most else []
    rows.append(("Next", advice_of(studies, causes)))
    style = "adequate" if not prevalence else "causes_found"
    return header(f"cohort of {len(studies)} studies", title_of(studies), style, rows)


def _prevalence(rows: Sequence[Row], studies: int) -> list[Markup]:
    if not rows:
        return [element("p", "None.")]
    head = (
        "cause",
        "stage",
        "studies",
        "share [95 %]",
        "median gain",
        "false discovery rate below 5 % in",
        "ties with",
    )
    cells: list[list[Content]] = [
        [
            element("code", r["cause"]),
            stage_mark(r["stage"]),
            f"{r['studies']} of {studies}",
            f"{r['share_percent']:.0f} % [{r['share_low']:.0f}, {r['share_high']:.0f}]",
            percent(r["median_gain_percent"]),
            str(r["certain"]),
            _tied(r) or "-",
        ]
        for r in rows
    ]
    words = (
        "A study in which a cause was not named may still have it: small, or such as its trials cannot show. The false "
        "discovery rate is over all causes that were looked for in all studies."
    )
    return [html_table(head, cells, (2, 3, 4), prose=True), element("p", words, class_="soft")]


def _pooled(causes: Sequence[Row], rows: Sequence[Row]) -> list[Markup]:
    if not rows:
        return [element("p", "No value is known from two studies or more.")]
    words = (
        "Random-effects means over the studies, with the interval of the mean, how much the value differs from study "
        "to study beyond their own uncertainty (tau), and where the next would lie. A cause's size is of the studies "
        "in which it was named: where it is small it was not, so that the mean is that of those who have it, and "
        "somewhat too large."
    )
    head = ("of", "parameter", "studies", "mean [95 %]", "tau", "next study [95 %]", "I²", "all alike")
    table = html_table(head, [_pooled_cells(r) for r in rows], (2, 3, 4, 5, 6, 7))
    return [element("p", words, class_="soft"), table, *_forests(causes, rows)]


def _forests(causes: Sequence[Row], rows: Sequence[Row]) -> list[Markup]:
    """Return a forest plot of the first parameter of each cause that two studies or more have: that of its size."""
    means = {(r["cause"], r["parameter"]): r for r in rows}
    first: dict[str, str] = {}
    for row in causes:
        first.setdefault(row["cause"], row["parameter"])
    drawn = []
    for (cause, parameter), many in by_parameter(causes).items():
        if len(many) > 1 and first[cause] == parameter:
            forest = _forest(parameter, many, means.get((cause, parameter)))
            words = f"{cause}: {parameter} with its 95 % interval in each study, and pooled"
            drawn.append(figure(forest, words, file=f"{cause}_{parameter}"))
    return [element("div", joined(drawn), class_="grid")] if drawn else []


def _by_cause(studies: Sequence[Row], causes: Sequence[Row]) -> list[Markup]:
    """Return the heat map of studies by causes: loss without a named cause, equivalents, and what is not testable."""
    named = [r["cause"] for r in causes]
    columns = list(dict.fromkeys([*named, *(n for r in causes for n in r["equivalents"].split())]))
    if not columns or len(studies) > FOREST:
        return []
    cells: dict[tuple[str, str], HeatCell] = {}
    for study in studies:
        cells |= {(study["study"], n): "not testable" for n in (study["not_testable"] or "").split()}
    for row in causes:
        cells |= {(row["study"], n): "equivalent" for n in row["equivalents"].split()}
    cells |= {(r["study"], r["cause"]): r["gain_percent"] for r in causes}
    words = (
        "Named causes by what is lost without them, percent of the nominal squared error above the noise; = equivalent "
        "to a named cause; x not testable with these data; empty: not named."
    )
    drawn = heat_drawing([r["study"] for r in studies], columns, cells)
    return [figure(drawn, words, "narrow" if len(columns) <= FEW else "", "studies_by_causes")]


def _pooled_cells(r: Row) -> list[Content]:
    error = (r["high"] - r["low"]) / 4.0
    bounds = [rounded(r[n], error) for n in ("next_low", "next_high") if math.isfinite(r[n])]
    return [
        element("code", r["cause"]) if r["cause"] else "the rig",
        element("code", r["parameter"]),
        f"{r['studies']} of {r['of']}",
        f"{rounded(r['mean'], error)} [{rounded(r['low'], error)}, {rounded(r['high'], error)}]",
        rounded(r["between"], error),
        f"[{', '.join(bounds)}]" if bounds else "-",
        f"{r['heterogeneity']:.0f} %",
        probability(r["p_alike"]),
    ]


def _forest(parameter: str, rows: Sequence[Row], mean: Row | None) -> Drawing:
    """Values of a parameter study by study with their 95 % intervals, and the pooled mean below."""
    known = [r for r in rows if math.isfinite(r["value"])]
    lines = [(r["study"], r["value"], *_ends(r), "measured") for r in known] if len(known) <= FOREST else []
    if mean is not None:
        lines.append((f"pooled, {mean['studies']} studies", mean["mean"], mean["low"], mean["high"], "extended"))
    return intervals_drawing(lines, parameter)


def _ends(row: Row) -> tuple[float, float]:
    """Return the ends of the 95 % interval of a value: as its study has them, or from its deviation."""
    half = CONFIDENCE_95 * row["std"]
    return (row["low"], row["high"]) if math.isfinite(row["low"]) else (row["value"] - half, row["value"] + half)


def _studies(rows: Sequence[Row]) -> list[Markup]:
    head = ("study", "verdict", "causes", "E free", "E ahead", "lack of fit")
    cells: list[list[Content]] = []
    for r in rows:
        if r["verdict"] == "failed":
            cells.append([r["study"], "failed", r["error"], "-", "-", "-"])
            continue
        link = element("a", r["study"], href=f"studies/{r['study']}/report.html")
        free = _errors(r, "fit" if math.isnan(r["nominal_held_out_percent"]) else "held_out")
        left = "found" if r["unexplained"] else "none found"
        cells.append([link, r["verdict"].replace("_", " "), r["causes"] or "-", free, _errors(r, "horizon"), left])
    made = html_table(head, cells, (3, 4))
    about = element("p", f"{E_WORDS} {MODELS}", class_="soft")
    return [about, made if len(rows) <= FOREST else folded(f"All {len(rows)} studies", made)]


def _errors(row: Row, name: str) -> str:
    """E of the nominal and of the extended model; of one alone where both are the same."""
    pair = [percent(row[f"{model}_{name}_percent"]) for model in ("nominal", "extended")]
    return " \u2192 ".join(dict.fromkeys(pair))
