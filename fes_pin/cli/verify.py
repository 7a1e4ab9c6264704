"""`fes-pin verify`: a saved model on the trials of a study, none of its values fitted again."""

from pathlib import Path
from typing import Annotated

import typer

from fes_pin.cli.group import python_names
from fes_pin.cli.options import Exclude, Libraries, Trials, study_of
from fes_pin.cli.progress import catalogue_with, print_found, say_whose_code


@python_names(horizon_s="--horizon", library="--library")
def verify(
    study: Annotated[Path, typer.Argument(help="Folder of a study, or its study.toml.")],
    model: Annotated[Path, typer.Argument(help="model.toml of a diagnosis.")],
    horizon: Annotated[
        float | None, typer.Option(min=0.0, metavar="SECONDS", help="How far ahead. [default: as a diagnosis looks]")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="The same as JSON.")] = False,
    trials: Trials = None,
    exclude: Exclude = None,
    library: Libraries = None,
) -> None:
    """Say whether a saved model explains trials within its noise; exit code 1 where it does not."""
    from fes_pin.diagnosis.verification import verify as find

    catalogue = catalogue_with(library)
    found = find(study_of(study, catalogue, trials, exclude), model, horizon_s=horizon, library=catalogue)
    say_whose_code(catalogue)
    print_found(found, as_json)
    if found.remainder.unexplained:
        raise typer.Exit(1)
