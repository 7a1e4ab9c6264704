"""Whether the numbers of an answer are the same at the terminal, on its page and in its JSON file: the command line."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated

import typer
from harness.__main__ import planned
from harness.generators import generator_of
from harness.run import made

from printed_numbers.read import Printed, Saved, page_text, printed_in, terminal_text

FAMILIES = {
    **{name: ("diagnose", name) for name in ("free", "driven", "imposed", "walking")},
    "contrast": ("contrast", "contrast"),
    "compare": ("compare", "misread"),
}
"""Command that answers, and generator of its studies, by family."""


def answered(command: str, study: Path, out: Path) -> str:
    """Return what a command prints in one line a row while it writes its answer into a folder."""
    asked = [sys.executable, "-P", "-m", "fes_pin", command, str(study), "--out", str(out)]
    run = subprocess.run(asked, capture_output=True, text=True, check=True, env={**os.environ, "COLUMNS": "200"})
    return run.stdout


def compared(printed: str, out: Path) -> list[Printed]:
    """Return the numbers that an answer prints at the terminal and on its page, each with whether it is saved."""
    (record,) = (p for p in out.glob("*.json") if p.stem in ("diagnosis", "contrast", "compare"))
    saved, page = Saved(json.loads(record.read_text())), out / "report.html"
    found = [*printed_in(terminal_text(printed), "terminal", saved)]
    return [*found, *printed_in(page_text(page.read_text()), "page", saved)] if page.exists() else found


def main(
    families: Annotated[list[str], typer.Argument(help=", ".join(FAMILIES))],
    count: Annotated[int, typer.Option(help="Studies of each family.")] = 1,
    seed: Annotated[int, typer.Option(help="Of the first.")] = 0,
) -> None:
    """Have studies answered, and compare the numbers that are printed of each answer with those that are saved."""
    wrong = 0
    for family in families:
        command, generator = FAMILIES[family]
        for item in planned(generator, count, seed, False, []):
            with tempfile.TemporaryDirectory() as folder:
                study, out = Path(folder, "study"), Path(folder, "answer")
                made(generator_of(generator), item, study)
                printed = answered(command, study, out)
                numbers = compared(printed, out)
            missed = [one for one in numbers if not one.is_saved]
            typer.echo(f"{family} {item.key}: {len(numbers)} numbers, {len(missed)} of them not saved")
            for one in missed:
                typer.echo(f"    {one.where}: {one.words}")
            wrong += len(missed)
    raise typer.Exit(int(wrong > 0))


if __name__ == "__main__":
    typer.run(main)
