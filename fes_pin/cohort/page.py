"""The page of a cohort: which causes in which studies, what is common to them, and each study's own report."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

from fes_pin.cohort.pool import pooled
from fes_pin.data.provenance import today, versions
from fes_pin.identify.error_measures import E_WORDS
from fes_pin.infer.text import percent, probability
from fes_pin.view.chart import Panel, svg
from fes_pin.view.drawing import Drawing, rows_csv
from fes_pin.view.page import Content, Markup, element, figure, folded, html_table, joined, page, section, value_text
from fes_pin.view.report_causes import stage_mark

PageRow = Mapping[str, Any]
FOREST = 40
"""Studies of one forest plot; of more only the pooled value is drawn."""
ROW, NAMES, WIDE = 20.0, 150.0, 420.0
MODELS = (
    "Of the nominal, then of the extended model, on trials held out where there are such. Free: from the inputs alone; "
    "ahead: each sample from what was measured up to the study's horizon before it. Of walking E is that of the ground "
    "reaction which the motion requires."
)
"""What is said of the errors of studies."""


def cohort_html(
    studies: Sequence[PageRow],
    causes: Sequence[PageRow],
    pooled_: Sequence[PageRow],
    prevalence: Sequence[PageRow],
    seed: int,
    command: str = "",
) -> str:
    """The page, which links the reports beside it and needs nothing else."""
    good = [r for r in studies if r["verdict"] != "failed"]
    parts = [
        _head(studies, good, prevalence),
        section("Which causes, and in how many studies", *_prevalence(prevalence, len(good))),
        section("How large they are in the population", *_pooled(causes, pooled_)),
        section("Studies", *_studies(studies)),
        section("Where this comes from", *_provenance(seed, command)),
    ]
    return page("Cohort", parts)


def _head(studies: Sequence[PageRow], good: Sequence[PageRow], prevalence: Sequence[PageRow]) -> Markup:
    counts = Counter(r["verdict"] for r in good)
    failed = len(studies) - len(good)
    if prevalence:
        first = prevalence[0]
        name = first["cause"].replace("_", " ")
        title = f"{name[0].upper()}{name[1:]} in {first['studies']} of {len(good)} studies"
    else:
        title = f"No cause is named in {len(good)} studies"
    rows = [
        ("A cause was named", f"in {counts['causes_found']} of {len(good)} studies"),
        ("The model is adequate", f"in {counts['adequate']}"),
        ("Something stays unexplained", f"in {sum(bool(r['unexplained']) for r in good)}"),
    ]
    if counts["stopped"]:
        rows.append(("The search was stopped", f"in {counts['stopped']}: the causes are the best set so far"))
    if failed:
        rows.append(("Could not be diagnosed", f"{failed}: see the table of studies"))
    made = [element("div", element("dt", q), element("dd", a)) for q, a in rows]
    return element(
        "header",
        element("p", f"cohort of {len(studies)} studies", class_="eyebrow"),
        element("h1", title, class_="verdict causes_found"),
        element("dl", joined(made), class_="answers"),
    )


def _prevalence(rows: Sequence[PageRow], studies: int) -> list[Markup]:
    if not rows:
        return [element("p", "None.")]
    head = (
        "cause",
        "stage",
        "studies",
        "share [95 %]",
        "median gain",
        "told apart in",
        "false discovery rate below 5 % in",
    )
    cells: list[list[Content]] = [
        [
            element("code", r["cause"]),
            stage_mark(r["stage"]),
            f"{r['studies']} of {studies}",
            f"{r['share_percent']:.0f} % [{r['share_low']:.0f}, {r['share_high']:.0f}]",
            _percent(r["median_gain_percent"]),
            str(r["alone"]),
            str(r["certain"]),
        ]
        for r in rows
    ]
    words = (
        "A study in which a cause was not named may still have it: small, or such as its trials cannot show. The false "
        "discovery rate is over all causes that were looked for in all studies."
    )
    return [html_table(head, cells, (2, 3, 4, 5, 6)), element("p", words, class_="soft")]


def _percent(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.0f} %"


def _pooled(causes: Sequence[PageRow], rows: Sequence[PageRow]) -> list[Markup]:
    if not rows:
        return [element("p", "No value is known from two studies or more.")]
    words = (
        "Random-effects means over the studies, with the interval of the mean, how much the value differs from study "
        "to study beyond their own uncertainty (tau), and where the next would lie. A cause's size is of the studies "
        "in which it was named: where it is small it was not, so that the mean is that of those who have it, and "
        "somewhat too large."
    )
    head = ("of", "parameter", "studies", "mean [95 %]", "tau", "next study [95 %]", "I²", "all alike")
    out = [element("p", words, class_="soft"), html_table(head, [_pooled_cells(r) for r in rows], (2, 3, 4, 5, 6, 7))]
    values: dict[tuple[str, str], list[PageRow]] = defaultdict(list)
    for row in causes:
        values[row["cause"], row["parameter"]].append(row)
    drawn, shown = [], set()
    for (cause, parameter), many in values.items():
        if len(many) > 1 and cause not in shown:
            shown.add(cause)  # the first parameter is what gives a cause its size
            drawn.append(figure(_forest(cause, parameter, many), f"{cause}, {parameter}", file=f"{cause}_{parameter}"))
    return [*out, element("div", joined(drawn), class_="grid")] if drawn else out


def _pooled_cells(r: PageRow) -> list[Content]:
    error = (r["high"] - r["low"]) / 4.0
    bounds = [value_text(r[n], error) for n in ("next_low", "next_high") if math.isfinite(r[n])]
    return [
        element("code", r["cause"]) if r["cause"] else "the rig",
        element("code", r["parameter"]),
        f"{r['studies']} of {r['of']}",
        f"{value_text(r['mean'], error)} [{value_text(r['low'], error)}, {value_text(r['high'], error)}]",
        value_text(r["between"], error),
        f"[{', '.join(bounds)}]" if bounds else "-",
        f"{r['heterogeneity']:.0f} %",
        probability(r["p_alike"]),
    ]


def _forest(cause: str, parameter: str, rows: Sequence[PageRow]) -> Drawing:
    """Values of a parameter study by study with their 95 % intervals, and the pooled mean beneath."""
    known = [r for r in rows if math.isfinite(r["value"])]
    drawn = [r for r in known if math.isfinite(r["std"])] if len(known) <= FOREST else []
    mean = pooled([r["value"] for r in known], [r["std"] for r in known])
    lines = [(r["study"], r["value"], r["value"] - 1.96 * r["std"], r["value"] + 1.96 * r["std"]) for r in drawn]
    if mean is not None:
        lines.append(("pooled", mean.mean, mean.low, mean.high))
    low, high = min(x[2] for x in lines), max(x[3] for x in lines)
    room = 0.05 * (high - low) or 1.0
    count = len(lines)
    panel = Panel(NAMES, 6, WIDE - NAMES - 12, ROW * count, (low - room, high + room), (0.5 - count, 0.5))
    for k, (name, value, least, most) in enumerate(lines):
        is_mean = name == "pooled" and k == count - 1 and mean is not None
        colour = "extended" if is_mean else "measured"
        panel.text(NAMES - 8, 6 + ROW * (k + 0.5) + 4, name[-22:], "end")
        panel.line([least, most], [-k, -k], colour, 3.0 if is_mean else 1.2)
        panel.dot(value, -k, colour, hollow=not is_mean)
    panel.x_axis(parameter)
    last = lines[-1]
    words = (
        f"{parameter} of {cause} in {len(known)} studies; {last[0]} {last[1]:.4g} from {last[2]:.4g} to {last[3]:.4g}."
    )
    return Drawing(
        svg([panel], WIDE, 6 + ROW * count + 38, words),
        rows_csv(("study", "value", "std"), [(r["study"], r["value"], r["std"]) for r in known]),
    )


def _studies(rows: Sequence[PageRow]) -> list[Markup]:
    head = ("study", "verdict", "causes", "E free", "E ahead", "left")
    cells: list[list[Content]] = []
    for r in rows:
        if r["verdict"] == "failed":
            cells.append([r["study"], "failed", r["error"], "-", "-", "-"])
            continue
        link = element("a", r["study"], href=f"studies/{r['study']}/report.html")
        free = _errors(r, "fit" if math.isnan(r["nominal_held_out_percent"]) else "held_out")
        left = "something" if r["unexplained"] else "nothing"
        cells.append([link, r["verdict"].replace("_", " "), r["causes"] or "-", free, _errors(r, "horizon"), left])
    made = html_table(head, cells, (3, 4))
    return [
        element("p", f"{E_WORDS} {MODELS}", class_="soft"),
        made if len(rows) <= FOREST else folded(f"All {len(rows)} studies", made),
    ]


def _errors(row: PageRow, name: str) -> str:
    """E of the nominal and of the extended model; of one alone where both are the same."""
    pair = [percent(row[f"{model}_{name}_percent"]) for model in ("nominal", "extended")]
    return " \u2192 ".join(dict.fromkeys(pair))


def _provenance(seed: int, command: str) -> list[Markup]:
    told = ", ".join(f"{n} {v}" for n, v in versions().items())
    rows: list[list[Content]] = [["made", today()], ["seed", str(seed)], ["versions", told]]
    rows += [["command", element("code", command)]] if command else []
    return [element("div", html_table(("what", "value"), rows, prose=True), class_="provenance")]
