"""`fes-pin datasets`: the public recordings that the documentation uses, listed and fetched."""

from pathlib import Path
from typing import Annotated

import typer

from fes_pin.cli.group import needs, python_names
from fes_pin.cli.options import Force, offered, output
from fes_pin.cli.progress import print_text


def _names() -> list[str]:
    from fes_pin.data.datasets import DATASETS

    return list(DATASETS)


@needs(out="names", unverified="names", force="names")
@python_names(**{"unverified=True": "--unverified"})
def datasets(
    names: Annotated[
        list[str] | None, typer.Argument(help="To fetch. [default: list them]", autocompletion=offered(_names))
    ] = None,
    out: Annotated[Path | None, output("Folder to fetch into. [default: FES_PIN_DATA, or the user's cache]")] = None,
    unverified: Annotated[
        bool, typer.Option("--unverified", help="Keep what no checksum is known of and converts to other numbers.")
    ] = False,
    force: Force = False,
) -> None:
    """List the public data sets that the documentation uses; with names, fetch them and make them studies."""
    from fes_pin.data.datasets import DATASETS, download_all

    if names:
        for name, place in download_all(names, out, unverified, force).items():
            typer.echo(f"{name}: {place}")
        return
    for one in DATASETS.values():
        where = _where(one.name) or one.by_hand or f"fes-pin datasets {one.name}"
        print_text(f"{one.name}: {one.what}\n  {one.origin} ({one.licence})\n  {where}")


def _where(name: str) -> str:
    """Return the folder of a data set on this machine; "" without one."""
    from fes_pin.body.measured_walk import data_folder
    from fes_pin.data.datasets import WALKING_NAME, fetch
    from fes_pin.data.errors import InputError

    try:
        return f"here: {data_folder() if name == WALKING_NAME else fetch(name)}"
    except InputError:
        return ""
