"""The studies whose answers are frozen: free and driven rigs, imposed motion, contrasts, walks, and measured data."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain, cycle, islice
from pathlib import Path
from typing import NamedTuple

from harness.contrast import Pairs
from harness.driven import Driven, rows
from harness.free import Free
from harness.generator import Generator, Item, Truth
from harness.imposed import RIGS, Imposed
from harness.walking import Walks

import fes_pin as fp

SEED = 9_127_000
"""Of the first study of each generator. No rule was ever made or tried on these seeds."""
COUNTS = {"free": 120, "driven": 60, "imposed": 40, "contrast": 30, "walking": 20}
DRIVEN = ("plain", "recorded", "laboratory", "swing-up", "stimulated")
MEASURED = ("biceps_fes", "free_pendulum", "friction_damper", "rat_muscle", "servo_pendulum")
"""Studies of one rig each in the folder `data` of measured data."""
PRACTICE = ("practice", "practice_loops")
"""Folders of studies whose answers are known."""


class Frozen(NamedTuple):
    """A study whose answer is frozen.

    Attributes
    ----------
    kind
        "free", "driven", "imposed", "contrast", "walking" or "measured".
    generator, item
        What makes it; the item's key is its name in the table.
    """

    kind: str
    generator: Generator
    item: Item

    @property
    def name(self) -> str:
        """Kind and key."""
        return f"{self.kind} {self.item.key}"


def studies(shared: Path) -> list[Frozen]:
    """Every study, kinds in turn, so that any beginning of the list holds some of each.

    Parameters
    ----------
    shared
        Folder of the measured data.
    """
    queues = {
        "free": _of(Free(), Free().plan(SEED)),
        "driven": _driven(),
        "imposed": _of(Imposed(), _imposed()),
        "contrast": _of(Pairs(), Pairs().plan(SEED)),
        "walking": _of(walks := Walks(strength=False), walks.plan(SEED)),
        "measured": _of(measured := Measured(shared), measured.plan(0)),
    }
    each = {kind: list(islice(queue, COUNTS.get(kind))) for kind, queue in queues.items()}
    longest = max(map(len, each.values()))
    spread = [
        ((k + 0.5) / len(row) * longest, Frozen(kind, *one)) for kind, row in each.items() for k, one in enumerate(row)
    ]
    return [one for _, one in sorted(spread, key=lambda pair: pair[0])]


Made = tuple[Generator, Item]


def _of(generator: Generator, items: Iterable[Item]) -> Iterator[Made]:
    return ((generator, item) for item in items)


def _driven() -> Iterator[Made]:
    """Of five generators in turn, each with its own causes in turn."""
    causes = {name: cycle(rows(name)) for name in DRIVEN}
    for k, name in enumerate(cycle(DRIVEN)):
        generator = Driven(name)
        yield generator, generator.item(next(causes[name]), SEED + k)


def _imposed() -> Iterator[Item]:
    every = zip(*(cycle(Imposed().rows(rig)) for rig in RIGS), strict=False)
    pairs = chain.from_iterable(zip(RIGS, hidden, strict=True) for hidden in every)
    for k, (rig, hidden) in enumerate(pairs):
        yield Imposed().item(rig, hidden, SEED + k)


class Measured:
    """Studies of others, as they are."""

    ask = staticmethod(fp.diagnose)

    def __init__(self, shared: Path) -> None:
        self.shared = shared

    def plan(self, seed: int) -> Iterator[Item]:
        folders = [self.shared / "data" / name for name in MEASURED]
        folders += [one for name in PRACTICE for one in sorted((self.shared / name).iterdir())]
        for folder in folders:
            if (folder / "study.toml").exists():
                yield Item(f"{folder.parent.name}-{folder.name}", seed, part=str(folder))

    def make(self, item: Item, folder: Path) -> tuple[fp.Study, Truth]:
        return fp.read_study(item.part), Truth()
