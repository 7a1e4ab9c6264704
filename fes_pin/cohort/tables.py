"""A cohort as tables: a row a study, a row a parameter of a cause, a row a pooled value."""

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from fes_pin.cohort.one import Kept
from fes_pin.cohort.pool import discovery_rates, pooled, share_interval
from fes_pin.identify.error_measures import MEASURES
from fes_pin.infer.levels import UNUSUAL_LEVEL

Row = Mapping[str, Any]

ERRORS = {f"{model}_{n}_percent": (model, n) for model in ("nominal", "extended") for n in MEASURES}
"""Columns of errors E, by model and name in `diagnosis.json`: see `identify.error_measures`."""


def tables_of(kept: Iterable[Kept | None], candidates: int) -> dict[str, Sequence[Row]]:
    """Return the tables of a cohort, whose studies were each searched for so many candidates."""
    studies, causes, nominal = list[Row](), list[Row](), list[Row]()
    for one in filter(None, kept):
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
        "unexplained": found["remainder"]["unexplained"] if found else None,
        **{name: _number(found.get(model, {}).get("error_percent", {}).get(n)) for name, (model, n) in ERRORS.items()},
        "horizon_s": _number(found.get("horizon_s")),
        "ceiling_percent": _number(found.get("ceiling_percent")),
        "wall_s": _number(found.get("wall_s")),
        "error": one.error,
    }


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)


def cause_rows(one: Kept) -> list[Row]:
    """Return every parameter of every cause of a study."""
    return [row for cause in one.record.get("causes", ()) for row in _cause(one.name, cause)]


def with_rates(rows: Sequence[Row], tests: int) -> list[Row]:
    """Return the rows of causes with their false discovery rates; `tests` as `discovery_rates` takes them."""
    named = {(r["study"], r["cause"]): r["p_value"] for r in rows}
    rates = dict(zip(named, discovery_rates(list(named.values()), tests).tolist(), strict=True))
    return [{**r, "false_discovery_rate": rates[r["study"], r["cause"]]} for r in rows]


def _cause(study: str, cause: Mapping[str, Any]) -> list[Row]:
    gain = cause.get("gain_percent") or {}
    low, high = gain.get("ci95") or (None, None)
    return [
        {
            "study": study,
            "cause": cause["name"],
            "stage": cause.get("stage", ""),
            "parameter": name,
            "value": _number(one["value"]),
            "std": _number(one["std"]),
            "p_value": _number(cause.get("p_value")),
            "gain_percent": _number(gain.get("held_out")),
            "gain_low": _number(low),
            "gain_high": _number(high),
            "equivalents": " ".join(cause.get("equivalents", ())),
        }
        for name, one in cause["parameters"].items()
    ]


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
            }
        )
    return sorted(out, key=lambda r: (-r["studies"], r["cause"]))
