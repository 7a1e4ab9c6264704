"""Runs studies in one process or several; every result is one line of a file, so that a run can go on later."""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from going_on import keep, rows_of

from confusion_matrix.generator import Made, make
from confusion_matrix.judge import judge
from confusion_matrix.plan import Item, groups

Answer = Callable[[Made], dict[str, Any]]
"""What is said of a study, as a record."""


def plan(count: int, seed: int) -> list[tuple[Item, ...]]:
    """Groups of the stratified slice of at least `count` studies, cut to it."""
    out: list[tuple[Item, ...]] = []
    left = count
    for group in groups(seed):
        if left <= 0:
            break
        out.append(tuple(islice(group, left)))
        left -= len(out[-1])
    return out


def run_group(items: Sequence[Item], answer: Answer = judge) -> list[dict[str, Any]]:
    """Make and diagnose studies that are simulated together."""
    began = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="confusion") as folder:
        made = make(items, Path(folder))
        making = (time.perf_counter() - began) / len(items)
        return [{**_answered(one, answer), "making_s": round(making, 2)} for one in made]


def _answered(made: Made, answer: Answer) -> dict[str, Any]:
    try:
        return answer(made)
    except Exception as error:
        item = made.item
        known = {"id": item.name, "kind": item.kind, "rig": item.rig, "causes": list(item.causes), "form": item.form}
        return {**known, "noise": item.noise, "target": item.distance, "error": f"{type(error).__name__}: {error}"}


def run(
    wanted: Iterable[Sequence[Item]], results: Path | None, workers: int = 1, answer: Answer = judge
) -> list[dict[str, Any]]:
    """Results of studies, those in the file `results` included; new ones are appended to it as they come."""
    done = {record["id"]: record for record in rows_of(results)}
    wanted = [tuple(group) for group in wanted]
    todo = [part for group in wanted if (part := tuple(i for i in group if i.name not in done))]
    total, began, fresh = sum(len(g) for g in todo), time.perf_counter(), 0
    for records in _all(todo, workers, answer):
        for record in records:
            done[record["id"]] = keep(record, results)
            fresh += 1
        _bar(fresh, total, time.perf_counter() - began)
    names = {item.name for group in wanted for item in group}
    return [done[name] for name in sorted(names) if name in done]


def _all(todo: Sequence[Sequence[Item]], workers: int, answer: Answer) -> Iterable[list[dict[str, Any]]]:
    each = partial(run_group, answer=answer)
    if workers < 2:
        yield from map(each, todo)
        return
    with ProcessPoolExecutor(workers) as pool:
        yield from pool.map(each, todo)


def read(results: Path) -> dict[str, dict[str, Any]]:
    """Results of a file by study, whatever code made them; the last of each."""
    return {record["id"]: record for record in rows_of(results, whatever_code=True)}


def _bar(count: int, total: int, elapsed: float) -> None:
    if not sys.stderr.isatty():
        return
    width = round(30 * count / max(total, 1))
    left = elapsed / max(count, 1) * (total - count)
    print(f"\r[{'#' * width:30s}] {count}/{total}, {left / 60:.1f} min left ", end="", file=sys.stderr, flush=True)
