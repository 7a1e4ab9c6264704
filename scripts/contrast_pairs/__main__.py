"""Change something in one of two groups of trials, ask for the contrast, and count."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from driven_rigs.draw import Recording
from going_on import keep, rows_of

from contrast_pairs.driven import CAUSES as DRIVEN_CAUSES
from contrast_pairs.driven import NOMINAL as DRIVEN_NOMINAL
from contrast_pairs.driven import driven_pair
from contrast_pairs.free import CAUSES, NOMINAL, free_pair
from contrast_pairs.practice import EXACT, practice_pair
from fes_pin.contrasts.contrast import contrast
from fes_pin.data.study import Study, read_study

RIGS = ("ankle", "ankle", "driven", "muscle", "ankle", "joint", "driven", "ankle")
"""In turn."""


def plan(count: int, seed: int, nulls: bool, only: str | None = None) -> Iterator[tuple[int, str, tuple[str, ...]]]:
    """Seed, rig and changes of each study: none in every third, two in every ninth."""
    for k in range(seed, seed + count):
        rng = np.random.default_rng([k, 76])
        rig = only or RIGS[k % len(RIGS)]
        names = (*DRIVEN_NOMINAL, *DRIVEN_CAUSES) if rig == "driven" else (*NOMINAL[rig], *CAUSES[rig])
        wanted = 0 if nulls or k % 3 == 0 else 2 if k % 9 == 4 else 1
        yield k, rig, tuple(str(n) for n in rng.choice(names, wanted, replace=False))


def of_practice(folders: Sequence[Path], nulls: bool) -> Iterator[tuple[Study, str, tuple[str, ...]]]:
    """Every study twice: as it is, and with a change in one half."""
    number = 0
    for folder in folders:
        for file in sorted(folder.glob("*/study.toml")):
            study = read_study(file)
            exact = EXACT.get(study.rig, ())
            for changes in ((), (exact[number % len(exact)],)) if not nulls else ((),):
                yield practice_pair(study, changes), study.rig, changes
            number += 1


def judged(study: Study, seed: int, rig: str, changes: tuple[str, ...]) -> dict[str, Any]:
    """Contrast a study, and say how the answer compares with the truth."""
    row: dict[str, Any] = {"seed": seed, "study": study.name, "rig": rig, "changes": changes}
    began = time.process_time()
    try:
        found = contrast(study)
    except Exception as error:
        return {**row, "error": f"{type(error).__name__}: {error}"}
    named = [(c.name, *c.equivalents) for c in found.changes]
    told = {"verdict": found.verdict, "named": named, "common": found.common, "untestable": found.untestable}
    return {**row, **told, "seconds": round(time.process_time() - began, 1)}


def table(rows: Sequence[dict[str, Any]]) -> list[str]:
    """The counts."""
    good = [r for r in rows if "error" not in r]
    lines = [f"{len(rows)} pairs, {len(rows) - len(good)} ended in an error"]
    lines += [f"    {r['study']}: {r['error']}" for r in rows if "error" in r]
    for rig in ("", *dict.fromkeys(r["rig"] for r in good)):
        own = [r for r in good if rig in ("", r["rig"])]
        nulls, single = ([r for r in own if len(r["changes"]) == n] for n in (0, 1))
        double = [r for r in own if len(r["changes"]) == 2]
        first = sum(bool(r["named"]) and r["changes"][0] in r["named"][0] for r in single)
        alone = sum([list(n) for n in r["named"]] == [list(r["changes"])] for r in single)
        both = sum(all(any(c in n for n in r["named"]) for c in r["changes"]) for r in double)
        alarms, open_ = (sum(r["verdict"] == v for r in nulls) for v in ("changed", "unexplained"))
        lines.append(
            f"{rig or 'all':8s} nothing changed: {alarms} alarms and {open_} unexplained of {len(nulls)}; "
            f"one changed: in the first set {first}, alone {alone} of {len(single)}; two: both named {both} "
            f"of {len(double)}"
        )
    for r in good:
        wrong = r["named"] if not r["changes"] else not all(any(c in n for n in r["named"]) for c in r["changes"])
        if wrong or len(r["named"]) > len(r["changes"]):
            lines.append(f"    {r['study']} {r['seed']} {r['rig']} {r['changes']} -> {r['verdict']} {r['named']}")
    seconds = sorted(r["seconds"] for r in good) or [0.0]
    lines.append(f"a contrast takes {seconds[len(seconds) // 2]:.1f} s of a processor in the median")
    return lines


def main(
    count: Annotated[int, typer.Option(help="How many pairs.")] = 27,
    size: Annotated[
        float, typer.Option(help="d of a cause in all trials; of driven rigs its share in percent.")
    ] = 80.0,
    seed: Annotated[int, typer.Option(help="Of the first; each next one has the next seed.")] = 0,
    nulls: Annotated[bool, typer.Option(help="Change nothing in any.")] = False,
    rig: Annotated[str | None, typer.Option(help="One rig alone: ankle, muscle, joint or driven.")] = None,
    recorded: Annotated[bool, typer.Option(help="Driven rigs: their effort is measured, with noise.")] = False,
    low_pass: Annotated[float | None, typer.Option(help="Driven rigs: stored below so many Hz.")] = None,
    every: Annotated[int, typer.Option(help="Driven rigs: samples of the controller to a row of the log.")] = 1,
    practice: Annotated[
        list[Path] | None, typer.Option(help="Pairs out of the studies in this folder instead; may be repeated.")
    ] = None,
    results: Annotated[Path | None, typer.Option(help="A file of one line a pair, with which a run can go on.")] = None,
) -> None:
    """Change something on purpose in one of two groups, and count what the contrast makes of it."""
    os.environ.setdefault("FES_PIN_THREADS", "1")
    rows = rows_of(results)
    done = {r["seed"] for r in rows}
    if practice:
        for k, (study, own, changes) in enumerate(of_practice(practice, nulls)):
            if seed <= k < seed + count and k not in done:
                rows.append(keep(judged(study, k, own, changes), results))
    else:
        recording = Recording(recorded, low_pass, every)
        for k, drawn, changes in plan(count, seed, nulls, rig):
            if k in done:
                continue
            with tempfile.TemporaryDirectory(prefix="contrast") as folder:
                if drawn == "driven":
                    study = driven_pair(changes, size / 200.0, k, Path(folder), recording)
                else:
                    study = free_pair(drawn, changes, size, k, Path(folder))
                rows.append(keep(judged(study, k, drawn, changes), results))
    typer.echo("\n".join(table(rows)))


if __name__ == "__main__":
    typer.run(main)
