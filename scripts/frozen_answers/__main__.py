"""Freeze the answers of some 300 studies, or show what differs from the frozen ones."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Annotated, Any

import typer
from harness.compare import compared
from harness.generator import shared

from frozen_answers.answers import answer, beside_truth, differences
from frozen_answers.studies import Frozen, studies

TABLE = Path(__file__).with_name("answers.jsonl")


def read(table: Path) -> dict[str, dict[str, Any]]:
    """Rows of a table by kind and key."""
    if not table.exists():
        return {}
    rows = (json.loads(line) for line in table.read_text(encoding="utf-8").splitlines())
    return {f"{row['kind']} {row['key']}": row for row in rows}


def freeze(wanted: list[Frozen], table: Path) -> None:
    """Answer the studies that a table does not hold, and add them to it as they come."""
    done = read(table)
    for one in wanted:
        if one.name not in done:
            with table.open("a", encoding="utf-8") as file:
                file.write(json.dumps(answer(one)) + "\n")


def compare(wanted: list[Frozen], table: Path, store: Path, loosely: bool) -> int:
    """Print what differs, study by study, then who is right; the number of studies that differ.

    Parameters
    ----------
    store
        Answers of this code; those that it lacks are added.
    """
    frozen, odd, known = read(table), 0, list[Frozen]()
    for one in wanted:
        if one.name in frozen:
            known.append(one)
            freeze([one], store)
            if lines := differences(frozen[one.name], read(store)[one.name], loosely):
                odd += 1
                typer.echo(f"{one.name} (hidden: {', '.join(one.item.hidden) or '-'})")
                typer.echo("\n".join(f"    {line}" for line in lines))
    typer.echo(f"{len(known) - odd} of {len(known)} the same")
    answers, made = read(store), [one for one in known if one.kind != "measured"]
    rows = [[beside_truth(one, row[one.name], answers[one.name]["truth"]) for one in made] for row in (answers, frozen)]
    typer.echo("\n".join(compared(rows[0], {row.key: row for row in rows[1]})))
    return odd


def main(
    count: Annotated[int, typer.Option(help="How many studies: the first of all kinds in turn.")] = 40,
    every: Annotated[bool, typer.Option("--all", help="Every study.")] = False,
    kind: Annotated[str | None, typer.Option(help="Of one kind alone.")] = None,
    new: Annotated[bool, typer.Option("--freeze", help="Add to the table what it does not hold.")] = False,
    loosely: Annotated[
        bool, typer.Option("--loosely", help="Verdicts, sets, and values beyond 0.3 of their deviation.")
    ] = False,
    table: Annotated[Path, typer.Option(help="The table.")] = TABLE,
    store: Annotated[Path | None, typer.Option(help="File of answers, with which a comparison goes on.")] = None,
) -> None:
    """Freeze the answers of some 300 studies, or show what differs from the frozen ones."""
    wanted = [one for one in studies(shared()) if kind in (None, one.kind)]
    wanted = wanted if every else wanted[:count]
    if new:
        freeze(wanted, table)
        return
    with tempfile.TemporaryDirectory(prefix="same") as folder:
        odd = compare(wanted, table, store or Path(folder) / "answers.jsonl", loosely)
    if odd:
        raise typer.Exit(1)


if __name__ == "__main__":
    typer.run(main)
