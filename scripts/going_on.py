"""Many studies one after the other, with a line of results each, by which a run that was broken off goes on."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any


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
    rows = [json.loads(x) for x in results.read_text().splitlines()] if results and results.exists() else []
    done = {r["seed"] for r in rows}
    for k, piece in enumerate(work):
        if seed + k in done:
            continue
        rows.append(judged(piece, seed + k))
        if results:
            with results.open("a", encoding="utf-8") as file:
                file.write(json.dumps(rows[-1]) + "\n")
    return rows
