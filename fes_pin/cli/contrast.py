"""`fes-pin contrast`: what differs between groups of trials, or between two studies of one rig."""

from pathlib import Path
from typing import Annotated

import typer

from fes_pin.cli.group import needs
from fes_pin.cli.options import (
    Exclude,
    FailOn,
    Force,
    Libraries,
    Limit,
    Seed,
    Trials,
    Why,
    fail_on,
    output,
    study_of,
)
from fes_pin.cli.progress import catalogue_with, print_result, progress, say_whose_code


@needs(by="not after", trials="not after", exclude="not after")
def contrast(
    study: Annotated[Path, typer.Argument(help="Folder of a study whose trials have groups, or of what was before.")],
    out: Annotated[Path, output("Folder for contrast.json and report.html.")],
    after: Annotated[Path | None, typer.Argument(help="A study of the same rig: what is now.")] = None,
    by: Annotated[
        str | None, typer.Option(help="group, or a condition that every trial states. [default: group]")
    ] = None,
    groups: Annotated[str | None, typer.Option(help="Which groups, with commas between them.")] = None,
    seed: Seed = 0,
    limit: Limit = None,
    trials: Trials = None,
    exclude: Exclude = None,
    library: Libraries = None,
    force: Force = False,
    why: Why = None,
    fail: FailOn = None,
) -> None:
    """Say what differs between groups of trials, by how much, and what did not change."""
    from fes_pin.contrasts.contrast import contrast as find
    from fes_pin.data.outputs import Outputs
    from fes_pin.data.provenance import this_command
    from fes_pin.view.report import answer_files

    catalogue = catalogue_with(library)
    before = study_of(study, catalogue, trials, exclude)
    now = None if after is None else study_of(after, catalogue)
    outputs = Outputs("contrast", force)
    outputs.claim(out, ("contrast.json", "report.html"))  # what cannot be read or written is said before any work
    wanted = [g.strip() for g in groups.split(",") if g.strip()] if groups is not None else None
    with progress() as tell:
        found = find(
            before, now, by=by or "group", groups=wanted, library=catalogue, seed=seed, limit=limit, progress=tell
        )
    outputs.write(out, answer_files(found.by_command(this_command())))
    say_whose_code(catalogue)
    print_result(found, [line for name in why or () for line in found.explain(name)])
    typer.echo(f"report: {out / 'report.html'}")
    fail_on(found.verdict, fail)
