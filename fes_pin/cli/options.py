"""Options that several commands have: the library, which trials of a study, NAME=VALUE, where to write."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import number_in
from fes_pin.data.schema import one_of

if TYPE_CHECKING:
    from fes_pin.data.study import Study
    from fes_pin.models.catalogue import Catalogue


def offered(names: Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """Return what completes a word: those of some names that begin as it does."""
    return lambda incomplete: [name for name in names() if name.startswith(incomplete)]


def offered_lists(names: Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """Return what completes the last of several names with commas between them."""

    def complete(incomplete: str) -> list[str]:
        before, comma, last = incomplete.rpartition(",")
        return [before + comma + name for name in offered(names)(last)]

    return complete


def _causes() -> list[str]:
    from fes_pin.models.catalogue import catalogue_of
    from fes_pin.walk.effects import EFFECTS

    return [*(one.name for one in catalogue_of(None).effects), *(one.name for one in EFFECTS)]


Libraries = Annotated[
    list[str] | None,
    typer.Option("--library", help="A Python file, or the name of a module, with causes or rigs. Its code is run."),
]
Force = Annotated[bool, typer.Option("--force", help="Write over files that this command did not write as they are.")]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Of simulated critical values and bootstrap intervals.")]
Limit = Annotated[float | None, typer.Option("--limit", min=0.0, help="Seconds of a search; then the best set so far.")]
VERDICTS = ("adequate", "causes_found", "unexplained", "stopped", "changed", "nothing_changed")


def _verdicts(words: list[str] | None) -> list[str] | None:
    for word in words or ():
        one_of(word, VERDICTS, lambda message: InputError(message, column="--fail-on"))
    return words


FailOn = Annotated[
    list[str] | None,
    typer.Option(
        "--fail-on",
        help="A verdict with exit code 1; may be repeated.",
        callback=_verdicts,
        autocompletion=offered(lambda: VERDICTS),
    ),
]
Why = Annotated[
    list[str] | None,
    typer.Option("--why", help="A cause: print why it is named, or is not.", autocompletion=offered(_causes)),
]

Trials = Annotated[str | None, typer.Option("--trials", help="Only these trials: a,b, or a* for all that begin so.")]
Exclude = Annotated[str | None, typer.Option("--exclude", help="All trials but these: a,b, or a*.")]


def fail_on(verdict: str, failures: Sequence[str] | None) -> None:
    """End the command with exit code 1 where its verdict is one of the failures; its files are written by then."""
    if verdict in (failures or ()):
        raise typer.Exit(1)


def study_of(path: Path, catalogue: Catalogue, trials: str | None = None, exclude: str | None = None) -> Study:
    """The study that a command was given, with the trials that --trials and --exclude leave.

    Raises
    ------
    InputError
        As `read_study`; a trial that it has not, no trial left; --library for walking, which has no causes but its own.
    """
    from fes_pin.data.study import read_study

    study = read_study(path, rigs=catalogue.schemas())
    if study.schema.owner is None and catalogue.origins():
        raise InputError("brings causes of rigs; walking has none but its own", column="--library")
    if trials is None and exclude is None:
        return study
    names = [t.name for t in study.trials]
    wanted = names if trials is None else _named(trials, names, "--trials")
    left_out = [] if exclude is None else _named(exclude, names, "--exclude")
    if not (kept := [name for name in names if name in wanted and name not in left_out]):
        raise InputError("leaves no trial", column="--exclude")
    files = {key: file for key, file in study.files.items() if key.rpartition(".")[0] in ("", *kept)}
    return replace(study, trials=tuple(study.trial(name) for name in kept), files=files)


def _named(words: str, names: Sequence[str], option: str) -> list[str]:
    """Those of the names that words with commas between them are, or patterns of."""
    found: list[str] = []
    for word in [words] if words in names else [one.strip() for one in words.split(",")]:
        some = [word] if word in names else [name for name in names if fnmatchcase(name, word)]
        if not some:
            raise InputError(f"expected trials of {', '.join(names)}; found {word!r}", column=option)
        found += some
    return found


def output(help: str, *names: str) -> Any:
    """An option that says where to write; an empty path, as of a variable that is not set, is an input error."""
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


def numbers_of(option: str, values: Mapping[str, str]) -> dict[str, float]:
    """Numbers by name of `pairs`.

    Raises
    ------
    InputError
        A value that is no number.
    """
    return {name: number_in(text, partial(InputError, column=f"{option} {name}")) for name, text in values.items()}
