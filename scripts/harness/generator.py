"""What makes studies with known causes: one interface."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import fes_pin as fp

MISREAD = "condition_misread"
"""What the package names a condition that a trial did not have."""


@dataclass(frozen=True)
class Item:
    """One study of a plan.

    Attributes
    ----------
    key
        Its name, unlike all others of its generator.
    seed
        Of everything that is random in it.
    hidden
        Causes that are hidden in it, or changes between its groups.
    part
        Row of the table that it counts in, beside that of its number of causes; "" for none.
    outside
        The library has none of the causes.
    """

    key: str
    seed: int
    hidden: tuple[str, ...] = ()
    part: str = ""
    outside: bool = False


@dataclass(frozen=True)
class Truth:
    """What is true of a study.

    Attributes
    ----------
    parameters
        True values by their names in the answer; of a cause with a site or a trial, "cause at site".
    beside
        Causes that act a little and may be named as well.
    part
        Row of the table, where it is known only after the study was made.
    unseen
        A trial that is not in the study, on which the answer's model is judged: `kind`, `dt`, `output`, `columns` and
        `conditions`, as a `Trial` has them; {} where there is none.
    nearest
        The causes of the library that are nearest to what is hidden, where the library has no form of that; None where
        it has one.
    """

    parameters: Mapping[str, float] = field(default_factory=dict)
    beside: tuple[str, ...] = ()
    part: str | None = None
    unseen: Mapping[str, Any] = field(default_factory=dict)
    nearest: tuple[str, ...] | None = None


class Generator(Protocol):
    """Makes studies."""

    def plan(self, seed: int) -> Iterator[Item]:
        """Studies, as many as are asked for; any beginning holds some of each kind."""
        ...

    def make(self, item: Item, folder: Path) -> tuple[fp.Study, Truth]:
        """Make a study and say what is true of it; `folder` is for its files."""
        ...

    def ask(self, study: fp.Study, **options: Any) -> Any:
        """The answer of the package; options are those of `fp.diagnose`."""
        ...


def shared() -> Path:
    """Folder of the measured data: FES_PIN_DATA, or `shared` beside the repository."""
    return Path(os.environ.get("FES_PIN_DATA") or Path(__file__).parents[3] / "shared")
