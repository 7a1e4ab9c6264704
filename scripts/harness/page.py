"""The table of docs/accuracy.md, written from the counts of the last run of each generator, docs/data/accuracy.json."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from harness.generators import GENERATORS
from harness.row import Row
from harness.table import HEAD, counts, interval, lines_of, table

DOCS = Path(__file__).parents[2] / "docs"
DATA, PAGE = DOCS / "data" / "accuracy.json", DOCS / "accuracy.md"
JOINT = ("inertia_scale", "damping")
"""Parameters whose errors the page shows."""
BY_REGRESSION = ", regression"
"""What stands behind the name of a generator whose studies were answered by regression."""
BEGIN, END = "<!-- written by scripts/accuracy --page -->", "<!-- end -->"


def read() -> dict[str, Any]:
    """Command, hash of the code and counts of the last run of each generator."""
    found: dict[str, Any] = json.loads(DATA.read_text(encoding="utf-8"))
    return found


def write(name: str, command: str, rows: Sequence[Row]) -> None:
    """Put the counts of a run into the data, and write the page.

    Raises
    ------
    ValueError
        The rows are not of one code.
    """
    (code,) = {row.code for row in rows}
    data = {**read(), name: {"command": command, "code": code[:12], **counts(rows)}}
    known = [one for name in GENERATORS for one in (name, name + BY_REGRESSION)]
    order = [*known, *sorted(data.keys() - {*known})]
    data = {one: data[one] for one in order if one in data}
    DATA.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8"), data), encoding="utf-8")


def with_tables(text: str, data: Mapping[str, Any]) -> str:
    """The page with the tables of these data in it."""
    before, after = text.split(BEGIN, maxsplit=1)[0], text.split(END)[1]
    return f"{before}{BEGIN}\n{tables(data)}\n{END}{after}"


def tables(data: Mapping[str, Any]) -> str:
    """Counts of all generators, and beneath them what was run, and intervals, errors and times."""
    lines = [[f"`{name}`" if not k else "", *row] for name in data for k, row in enumerate(lines_of(data[name]))]
    runs = [[f"`{one['command']}`", one["code"], *_measured(one)] for one in data.values()]
    head = (
        "command",
        "code",
        "without an answer",
        "95 % intervals that hold the truth",
        "error E, nominal to extended",
        "inertia, damping off by",
        "processor time",
    )
    return "\n\n".join([table(("generator", *HEAD), lines), table(head, runs)])


def _measured(found: Mapping[str, Any]) -> list[str | int]:
    held, count = found["intervals"]
    errors = found["errors"].get("held_out") or found["errors"].get("horizon")
    return [
        found["unanswered"],
        interval(held, count) if count else "",
        f"{errors[0]:g} to {errors[1]:g} %" if errors else "",
        ", ".join(f"{found['off'][name][1]:g} %" for name in JOINT if name in found["off"]),
        f"{found['cpu_s']:g} s",
    ]
