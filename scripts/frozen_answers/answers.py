"""An answer as a row of the table, and how two rows differ."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from harness.generator import Truth
from harness.row import Row, judged

from fes_pin.infer.result import shown
from frozen_answers.studies import Frozen

LATER = ("explained", "judged_by")
"""What answers have said since the rows were frozen."""
DIGITS = 4
SHARE_OF_STD = 0.3
"""How far a value may move, in its deviations, where the likelihood that is maximised is another."""
LEFT_OUT = ("study", "wall_s", "provenance", "warnings", "next_experiment", "noise", "reason", "library")
"""What a row does not hold of an answer: what depends on the clock, and texts."""


def answer(one: Frozen) -> dict[str, Any]:
    """Make a study and answer it.

    Returns
    -------
    dict
        `kind`, `key`, `hidden`, `truth`, `answer` (the record, numbers to four digits) or `error`, and `cpu_s`, the
        processor time of the answer alone.
    """
    row: dict[str, Any] = {"kind": one.kind, "key": one.item.key, "hidden": list(one.item.hidden)}
    with tempfile.TemporaryDirectory(prefix="frozen") as folder:
        study, truth = one.generator.make(one.item, Path(folder))
        row["truth"] = asdict(truth)
        began = time.process_time()
        try:
            record = one.generator.ask(study).record()
        except Exception as error:
            return {**row, "error": f"{type(error).__name__}: {error}"}
        seconds = time.process_time() - began
    kept = {name: value for name, value in record.items() if name not in LEFT_OUT}
    return {**row, "answer": _rounded(kept), "cpu_s": round(seconds, 1)}


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _rounded(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(one) for one in value]
    return shown(value, DIGITS) if isinstance(value, float) else value


def beside_truth(one: Frozen, row: dict[str, Any], truth: dict[str, Any]) -> Row:
    """A row beside what is true of its study; its key is the study's name in the table."""
    item, known = replace(one.item, key=one.name), {"code": "", "cpu_s": row.get("cpu_s", 0.0)}
    if "error" in row:
        return Row(item.key, item.hidden, item.part, item.outside, error=row["error"], **known)
    return judged(item, Truth(**truth), row["answer"], **known)


def named(row: dict[str, Any]) -> list[Any]:
    """What a person reads first of a row: the verdict, and each cause or change with what it cannot be told from."""
    if "error" in row:
        return [row["error"]]
    found = row["answer"]
    sets = [
        [c["name"], c.get("site") or c.get("group"), sorted(c["equivalents"])]
        for c in found.get("causes", found.get("changes", ()))
    ]
    return [found["verdict"], *sets]


def differences(frozen: dict[str, Any], now: dict[str, Any], loosely: bool = False) -> list[str]:
    """What differs between a frozen row and the same study's answer now, one line each.

    Parameters
    ----------
    loosely
        Only the verdict, the sets, and values beyond `SHARE_OF_STD` of their deviation count.
    """
    if named(frozen) != named(now):
        return [f"{named(frozen)} -> {named(now)}"]
    if "error" in frozen:
        return []
    pairs = list(_leaves(frozen["answer"], now["answer"], ""))
    if not loosely:
        return [f"{where}: {old} -> {new}" for where, old, new in pairs if old != new]
    return [f"{where}: {old} -> {new}" for where, old, new in _moved(frozen["answer"], now["answer"])]


def _leaves(old: Any, new: Any, where: str) -> Iterator[tuple[str, Any, Any]]:
    if isinstance(old, dict) and isinstance(new, dict):
        for name in dict.fromkeys([*old, *(n for n in new if n not in LATER)]):
            yield from _leaves(old.get(name), new.get(name), f"{where}.{name}".lstrip("."))
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for k, (one, other) in enumerate(zip(old, new, strict=True)):
            yield from _leaves(one, other, f"{where}[{k}]")
    else:
        yield where, old, new


def _moved(old: dict[str, Any], new: dict[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    values = {where: pair for where, *pair in _leaves(old, new, "")}
    for where, (one, other) in values.items():
        std = values.get(f"{where.removesuffix('value')}std", (None, None))[0]
        if where.endswith(".value") and std and abs((other or 0.0) - one) > SHARE_OF_STD * std:
            yield where, one, other
