"""Options that several commands have: the library, which trials of a study, NAME=VALUE, where to write."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from fes_pin.data.errors import InputError

Libraries = Annotated[
    list[str] | None,
    typer.Option("--library", help="A Python file, or the name of a module, with causes or rigs. Its code is run."),
]
Force = Annotated[bool, typer.Option("--force", help="Write over files that this command did not write as they are.")]


def output(help: str, *names: str) -> Any:
    """An option that says where to write; one without a name, as of a variable that is not set, is refused."""
    return typer.Option(*names, parser=_output_path, metavar="PATH", help=help)


def _output_path(text: str) -> Path:
    if not text.strip():
        raise typer.BadParameter("expected a path, found nothing: is a variable of the shell not set?")
    return Path(text)


def pairs(option: str, words: Sequence[str] | None) -> dict[str, str]:
    """Values by name of an option that is given as NAME=VALUE, once for each name.

    Raises
    ------
    InputError
        Another form, or a name that is given twice.
    """
    out: dict[str, str] = {}
    for word in words or ():
        name, equals, value = (part.strip() for part in word.partition("="))
        if not equals or not name:
            raise InputError(f"expected {option} NAME=VALUE, found {word!r}")
        if name in out:
            raise InputError(f"expected {option} {name} once, found it again as {word!r}")
        out[name] = value
    return out
