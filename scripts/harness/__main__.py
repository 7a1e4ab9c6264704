"""Command line; see `scripts/accuracy`."""

from __future__ import annotations

import os
from itertools import islice
from pathlib import Path
from typing import Annotated

import typer

import fes_pin as fp
from fes_pin.data.sources import code_hash
from harness import page, varied
from harness.compare import compared
from harness.generator import Item
from harness.generators import GENERATORS, generator_of
from harness.row import Row
from harness.run import EFFORT, REGRESSION, TEN_LINES, rows_of, run
from harness.table import HEAD, against, counts, families, lines_of, never_worse, notes, table, totals, worse, wrong


def planned(name: str, count: int, seed: int, hidden: int | None, only: list[str]) -> list[Item]:
    """The studies that are asked for."""
    items = (item for item in generator_of(name).plan(seed) if hidden in (None, len(item.hidden)))
    return [item for item in islice(items, count) if not only or item.key in only]


def shown(rows: list[Row]) -> str:
    """The table of some rows, with notes and every study that was not answered rightly."""
    found = counts(rows)
    parts = ["", families(rows)] if len({row.part for row in rows}) > 1 else []
    return "\n".join([table(HEAD, lines_of(found)), *parts, "", *totals(rows), *notes(found), *wrong(rows)])


def main(
    generators: Annotated[
        list[str], typer.Argument(help=f"{', '.join((*GENERATORS, *varied.KINDS))}; or folders of studies.")
    ],
    count: Annotated[int, typer.Option(help="Studies of each generator.")] = 40,
    seed: Annotated[int, typer.Option(help="Of the first; each next one has the next seed.")] = 0,
    hidden: Annotated[int | None, typer.Option(min=0, help="Only studies that hide so many causes.")] = None,
    only: Annotated[list[str] | None, typer.Option(help="Of these, the one of this key; may be repeated.")] = None,
    workers: Annotated[int, typer.Option(help="Processes.")] = os.cpu_count() or 1,
    store: Annotated[Path | None, typer.Option(help="Folder of answers, with which a run goes on.")] = None,
    studies: Annotated[Path | None, typer.Option(help="Folder of studies: kept there, and read from there.")] = None,
    stored: Annotated[bool, typer.Option("--stored", help="Run nothing: the store's answers, of any code.")] = False,
    compare: Annotated[Path | None, typer.Option(help="Another store: both on the same studies.")] = None,
    check: Annotated[bool, typer.Option("--check", help="Exit code 1 if worse than the committed page.")] = False,
    regression: Annotated[bool, typer.Option("--regression", help="The answers of a ten-line regression.")] = False,
    by_effort: Annotated[
        bool, typer.Option("--effort", help="The answers of inverse dynamics, `fes_pin.effort`.")
    ] = False,
    by_ten_lines: Annotated[bool, typer.Option("--ten-lines", help="Beside a ten-line fit of the motion.")] = False,
    withholds: Annotated[
        bool, typer.Option("--never-worse", help="Withhold trials; errors against the believed model and a regression.")
    ] = False,
    limit: Annotated[float | None, typer.Option(min=0.0, help="Seconds that the search of a study may take.")] = None,
    draws: Annotated[int, typer.Option(min=2, help="Of `starts`: starts of each study.")] = varied.DRAWS,
    onto_page: Annotated[bool, typer.Option("--page", help="Write the counts into docs/accuracy.md.")] = False,
) -> None:
    """Hide known causes in studies, and count what the answers make of them."""
    typer.echo(f"fes_pin of {Path(fp.__file__).parent}, code {code_hash()[:12]}")
    known_names = {*GENERATORS, *varied.KINDS}
    if unknown := [name for name in generators if name not in known_names and not Path(name, "answers").is_dir()]:
        raise typer.BadParameter(f"{', '.join(unknown)}: neither a generator nor a folder of studies and `answers`")
    bad = False
    for name in generators:
        if name in varied.KINDS:
            plan, place = (
                varied.planned(name, count, seed, only or [], draws),
                store / f"{name}.jsonl" if store else None,
            )
            answers = varied.run(name, plan, place, workers, limit, stored)
            typer.echo(f"\n{name}\n\n{varied.shown(name, plan, answers)}")
            continue
        items = planned(name, count, seed, hidden, only or [])
        by = EFFORT if by_effort else REGRESSION * regression
        label = Path(name).name + f", {by}" * bool(by) + ", withheld" * withholds
        file = store / f"{label}.jsonl" if store else None
        known = rows_of(file, None)
        rows = (
            [known[i.key] for i in items if i.key in known]
            if stored
            else run(name, items, file, studies, workers, by, limit, withholds)
        )
        typer.echo(f"\n{label}\n\n{shown(rows)}")
        if withholds:
            typer.echo("\n".join(["", *never_worse(rows)]))
        if by_ten_lines:
            place = store / f"{label}, {TEN_LINES}.jsonl" if store else None
            others = (
                list(rows_of(place, None).values()) if stored else run(name, items, place, studies, workers, TEN_LINES)
            )
            typer.echo("\n".join([f"\n{label}, {TEN_LINES}\n", *totals(others), "", *against(rows, others)]))
        if compare:
            typer.echo("\n".join(["", *compared(rows, rows_of(compare / f"{label}.jsonl", None))]))
        if check:
            said = worse(counts(rows), page.read().get(label, {"rows": {}}))
            bad = bad or bool(said)
            typer.echo("\n".join(said) or "no worse than docs/accuracy.md")
        if onto_page:
            if len(rows) < len(items):
                raise typer.BadParameter(f"{label}: {len(rows)} of {len(items)} studies have an answer in the store")
            command = (
                f"scripts/accuracy {name} --count {count} --seed {seed}"
                + (f" --hidden {hidden}" if hidden is not None else "")
                + " --regression" * regression
            )
            page.write(label, command, rows)
    if bad:
        raise typer.Exit(1)


if __name__ == "__main__":
    typer.run(main)
