"""Views of recordings, right and odd: keys of a `[[trial]]`, times that start again or have holes, files that join."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

NUMBERS = ("0.3", "-1", "0.9", "1e300", "nan", '"a"', "true", "[]", "1e-9", "{}")
KEYS = {
    "from": NUMBERS,
    "to": NUMBERS,
    "at": ("[0.3, 0.6]", "[]", "[nan]", "0.5", '["a"]', "[0.5, 0.5]", "[1e300]"),
    "split": ('"restarts"', '"holes"', '"rests"', '"position"', '"no_such"', '""', "1", '"time_s"'),
    "rate": ("50", "33.3", "0", "-5", "1e9", "1e-9", '"a"'),
    "derive": ('{ position = "velocity" }', "{}", '{ position = "effort" }', "3", '{ velocity = "position" }'),
    "offset_s": ('{ a = "fit" }', "{ a = 0.01 }", "{}", "1", '{ b = "x" }'),
    "sheet": ('"Sheet1"', '""', "1"),
    "sources": ('{ a = "trials/00.csv" }', '{ a = "trials/00.csv", b = "trials/01.csv" }', "{}", "3", '{ "" = "a" }'),
}
"""Values of each key, of which some cannot be."""


def with_views(study: Path, rng: np.random.Generator) -> None:
    """Give the trials of a study views of their files, of which some start again or have holes."""
    place = study / "study.toml"
    head, *tables = re.split(r"(?=^\[\[trial\]\]$)", place.read_text(encoding="utf-8"), flags=re.M)
    place.write_text(head + views(rng, tables), encoding="utf-8")
    for path in sorted(study.glob("trials/*.csv")):
        if rng.uniform() < 0.5:
            path.write_text(_broken(path.read_text(encoding="utf-8"), rng), encoding="utf-8")


def views(rng: np.random.Generator, tables: list[str]) -> str:
    """Tables `[[trial]]`, with keys of views."""
    out = [f'[sources.{n}]\ntime_s = "time_s"\n' for n in "ab"] if rng.uniform() < 0.5 else []
    for table in tables:
        names = rng.choice(list(KEYS), int(rng.integers(3)), replace=False)
        given = [f"{name} = {rng.choice(KEYS[name])}" for name in names]
        of_file = re.sub(r"^file = .*\n", "", table, flags=re.M) if "sources" in names else table
        out.append("\n".join([of_file.rstrip(), *given]) + "\n\n")
    return "".join(out)


def _broken(text: str, rng: np.random.Generator) -> str:
    """A recording that is there twice, has holes, or loses its last rows."""
    names, *rows = text.splitlines()
    if rng.uniform() < 0.4:
        return "\n".join([names, *rows, *rows[: int(rng.integers(1, len(rows)))]]) + "\n"
    begin = int(rng.integers(1, len(rows)))
    return "\n".join([names, *rows[:begin], *rows[begin + int(rng.integers(1, 40)) :]]) + "\n"
