"""Many studies one after the other, with a line of results each, by which a run that was broken off goes on.

Each line holds a hash of the code that made it: after a change of the package a run begins again, and the lines of the
code before stay in the file.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from fes_pin.data.sources import code_hash

CODE = "code"
"""Key of a line: the hash of the code that made it."""


def rows_of(results: Path | None, whatever_code: bool = False) -> list[dict[str, Any]]:
    """The lines of a file that this code made, in order; none of a file that is not there.

    Parameters
    ----------
    whatever_code
        Also those that other code made.
    """
    if results is None or not results.exists():
        return []
    rows = [json.loads(line) for line in results.read_text(encoding="utf-8").splitlines() if line.strip()]
    return [r for r in rows if whatever_code or r.get(CODE) == code_hash()]


def keep(row: dict[str, Any], results: Path | None) -> dict[str, Any]:
    """A row with the hash of the code, as a file has it; appended to the file if there is one."""
    line = json.dumps({**row, CODE: code_hash()})
    if results:
        with results.open("a", encoding="utf-8") as file:
            file.write(line + "\n")
    made: dict[str, Any] = json.loads(line)
    return made


def results_of(
    work: Iterable[Any], seed: int, judged: Callable[[Any, int], dict[str, Any]], results: Path | None
) -> list[dict[str, Any]]:
    """The results of pieces of work, each with the next seed; those that the file holds are not made again.

    Parameters
    ----------
    judged
        Result of a piece of work and a seed, which it names as "seed".
    results
        File of one line a result; none is written without.
    """
    rows = rows_of(results)
    done = {r["seed"] for r in rows}
    for k, piece in enumerate(work):
        if seed + k not in done:
            rows.append(keep(judged(piece, seed + k), results))
    return rows
