"""What a person wants a new study to be made of."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from glob import escape
from pathlib import Path
from typing import Any

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import number_in
from fes_pin.data.schema import ROLES, NumberKey, RigSchema, one_of
from fes_pin.data.urdf import is_revolute

Ask = Callable[[str], str]
"""Puts a question to a person and gives the answer."""


@dataclass(frozen=True)
class Wanted:
    """What a new study is to be made of.

    Parameters
    ----------
    files
        Recordings.
    schema
        Of the rig.
    folder
        Of the study: files inside it stay where they are, others are copied as they are.
    name
        Of the study.
    urdf
        Of a rig that has one: a file, or a template that is held.
    columns
        By the rig's column what a person said of it: `NAME[:UNIT][,zero=...][,scale=...]`.
    settings
        By key, numbers of the rig, start values, conditions of all trials; by `FILE:key` of one trial alone.
    kind
        Of all trials; None if their columns decide it.
    labels
        Of trials: by "role" and "group" what was said of files, by `FILE`.
    resample_hz, fill
        See `[columns.file]`.
    sources
        By the name of a source the pattern of its files, where a trial has several.
    split, offsets
        See `[[trial]]`; None and empty where nothing was said.
    form
        What was said of how text files are written, by the keys of `[columns.file]`.
    ask
        None where nobody can be asked.
    say
        Prints something before a person is asked; None where nothing is printed.
    """

    files: tuple[Path, ...]
    schema: RigSchema
    folder: Path
    name: str
    urdf: Path | None = None
    columns: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, str] = field(default_factory=dict)
    kind: str | None = None
    labels: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    resample_hz: float | None = None
    fill: bool = False
    sources: Mapping[str, str] = field(default_factory=dict)
    split: str | None = None
    offsets: Mapping[str, float | str] = field(default_factory=dict)
    form: Mapping[str, Any] = field(default_factory=dict)
    ask: Ask | None = None
    say: Callable[[str], None] | None = None

    @cached_property
    def revolute(self) -> bool | None:
        """Whether the rig's joint turns; None if it has none."""
        return is_revolute(self.urdf)


def number_set(key: str, text: str, number: NumberKey) -> float:
    """The number that was set for a key.

    Raises
    ------
    InputError
        The text says none, or one out of bounds.
    """
    error = partial(InputError, column=f"--set {key}")
    return number.check(number_in(text, error), error)


def of_files(files: Sequence[Path], option: str, said: Mapping[str, str]) -> dict[tuple[Path, str], str]:
    """What was said of files, as `FILE`, or as `FILE:KEY` of --set, by file and key ("" for none).

    A file is named by the end of its path, with or without its suffix; a pattern with * may name several.

    Raises
    ------
    InputError
        A name of no file, or of several; the same said twice of a file.
    """
    out: dict[tuple[Path, str], str] = {}
    for words, value in said.items():
        name, colon, key = words.rpartition(":") if option == "--set" else (words, ":", "")
        if not colon:
            continue
        place = f"{option} {words}"
        pattern = name if "*" in name else escape(name)
        found = [path for path in files if name and (path.match(pattern) or path.with_suffix("").match(pattern))]
        if not found:
            raise InputError(f"expected one of the files, found {name!r}", column=place)
        if len(found) > 1 and "*" not in name:
            raise InputError(f"names several files: expected {' or '.join(map(str, found))}", column=place)
        for path in found:
            if (path, key) in out:
                raise InputError(f"is said twice of {path.name}", column=place)
            out[path, key] = value
    return out


def labels_of(wanted: Wanted, *files: Path) -> dict[str, str]:
    """Role and group of the trial that files make, where they were said.

    Raises
    ------
    InputError
        As `of_files`; a role that is none.
    """
    labels: dict[str, str] = {}
    for key, said in wanted.labels.items():
        found = of_files(wanted.files, f"--{key}", said)
        for label in [found[path, ""] for path in files if (path, "") in found][:1]:
            if key == "role":
                one_of(label, ROLES, partial(InputError, column="--role"))
            labels[key] = label
    return labels
