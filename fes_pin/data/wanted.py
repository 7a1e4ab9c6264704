"""What a person wants a new study to be made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import number_in
from fes_pin.data.schema import NumberKey, RigSchema

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
        Of a rig that has one: a file, or the text of a template with its name.
    revolute
        Whether the rig's joint turns; None if it has none.
    columns
        By the rig's column what a person said of it: `NAME[:UNIT][,zero=...][,scale=...]`.
    settings
        By key, numbers of the rig, start values, conditions of all trials; by `FILE:key` of one trial alone.
    kind
        Of all trials; None to be told from their columns.
    resample_hz, fill
        See `[columns.file]`.
    ask
        None where nobody can be asked.
    """

    files: tuple[Path, ...]
    schema: RigSchema
    folder: Path
    name: str
    urdf: Path | tuple[str, str] | None = None
    revolute: bool | None = None
    columns: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, str] = field(default_factory=dict)
    kind: str | None = None
    resample_hz: float | None = None
    fill: bool = False
    ask: Ask | None = None


def number_set(key: str, text: str, number: NumberKey) -> float:
    """The number that was set for a key.

    Raises
    ------
    InputError
        The text says none, or one out of bounds.
    """
    try:
        return number.check(number_in(text))
    except ValueError as problem:
        raise InputError(str(problem), column=f"--set {key}") from None
