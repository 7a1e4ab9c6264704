"""`fes-pin compare`: models from the literature on a study's trials, ranked by errors on held-out trials."""

from pathlib import Path
from typing import Annotated

import typer

from fes_pin.cli.group import python_names
from fes_pin.cli.options import Exclude, Force, Libraries, Trials, offered_lists, output, study_of
from fes_pin.cli.progress import catalogue_with, print_result, progress, say_whose_code

FILE = "compare.json"


def _names() -> list[str]:
    from fes_pin.comparison.literature import LITERATURE

    return [one.name for one in LITERATURE]


@python_names(horizon_s="--horizon", given_s="--given", library="--library")
def compare(
    study: Annotated[Path, typer.Argument(help="Folder of a study of a muscle or an ankle, or its study.toml.")],
    models: Annotated[
        str | None,
        typer.Option(
            help="Names with commas between them: nominal,ding2003,hill ... [default: all]",
            autocompletion=offered_lists(_names),
        ),
    ] = None,
    model: Annotated[
        list[Path] | None, typer.Option("--model", help="model.toml of a diagnosis, too; may be repeated.")
    ] = None,
    horizon: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="How far ahead. [default: as a diagnosis looks]")
    ] = None,
    given: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="Also predict each trial from its first seconds.")
    ] = None,
    out: Annotated[Path | None, output("Folder for compare.json.")] = None,
    trials: Trials = None,
    exclude: Exclude = None,
    library: Libraries = None,
    force: Force = False,
) -> None:
    """Rank models from the literature by their errors on whole trials left out."""
    from fes_pin.comparison.compare import compare as find
    from fes_pin.data.outputs import Outputs

    catalogue = catalogue_with(library)
    measured = study_of(study, catalogue, trials, exclude)
    outputs = Outputs("compare", force)
    if out is not None:
        outputs.claim(out, (FILE,))  # what cannot be read or written is said before any work
    names = None if models is None else [n.strip() for n in models.split(",") if n.strip()]
    own = {str(path): path for path in model or ()}
    with progress() as tell:
        found = find(measured, names, extended=own, horizon_s=horizon, given_s=given, library=catalogue, progress=tell)
    if out is not None:
        outputs.write(out, {FILE: found.to_json()})
    say_whose_code(catalogue)
    print_result(found)
