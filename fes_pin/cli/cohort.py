"""`fes-pin cohort`: many studies, resumable, on this machine or on a Dask cluster."""

import os
from pathlib import Path
from typing import Annotated

import typer

from fes_pin.cli.group import complain, needs
from fes_pin.cli.options import Force, Libraries, Limit, Seed, output
from fes_pin.cli.progress import print_text, progress

SAID_EVERY_S = 30.0
"""Seconds between lines of progress where nobody watches."""


@needs(workers="not scheduler")
def cohort(
    studies: Annotated[list[Path], typer.Argument(help="Studies, or folders that hold studies.")],
    out: Annotated[Path, output("Folder for the answers, the tables and cohort.html; a run goes on in it.")],
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes on this machine; one a core without it.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler, as tcp://host:8786: its workers diagnose.")
    ] = None,
    seed: Seed = 0,
    limit: Limit = None,
    library: Libraries = None,
    force: Force = False,
) -> None:
    """Diagnose many studies, and say what they have in common. What is there already is not done again."""
    from fes_pin.cohort.run import run_cohort
    from fes_pin.data.provenance import this_command
    from fes_pin.data.show import table_text

    with progress(SAID_EVERY_S) as tell:
        made = run_cohort(
            studies,
            out,
            workers=workers or os.cpu_count() or 1,
            scheduler=scheduler,
            seed=seed,
            limit=limit,
            library=tuple(library or ()),
            command=this_command(),
            force=force,
            progress=tell,
        )
    title, head, rows, notes = made.as_table()
    print_text(table_text(title, head, rows, [one for one in notes if not one.startswith("failed")]))
    for row in made.failed:
        complain(f"failed: {row['study']}: {row['error']}")
    typer.echo(f"page: {out / 'cohort.html'}")
