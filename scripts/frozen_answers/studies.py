"""The studies whose answers are frozen: free and driven rigs, imposed motion, contrasts, walks, and measured data."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import chain, cycle, islice
from pathlib import Path

from harness.contrast import Pairs
from harness.driven import Driven, rows
from harness.free import Free
from harness.generator import Generator, Item
from harness.imposed import RIGS, Imposed
from harness.walking import Walks

from fes_pin.data.study import Study, read_study

SEED = 9_127_000
"""Of the first study of each generator. No rule was ever made or tried on these seeds."""
COUNTS = {"free": 120, "driven": 60, "imposed": 40, "contrast": 30, "walking": 20}
DRIVEN = ("plain", "recorded", "laboratory", "swing-up", "stimulated")
MEASURED = ("biceps_fes", "free_pendulum", "friction_damper", "rat_muscle", "servo_pendulum")
"""Studies of one rig each in the folder `data` of measured data."""
PRACTICE = ("practice", "practice_loops")
"""Folders of studies whose answers are known."""


@dataclass(frozen=True)
class Frozen:
    """A study whose answer is frozen.

    Attributes
    ----------
    kind
        "free", "driven", "imposed", "contrast", "walking" or "measured".
    key
        Its name in the table.
    make
        Makes the study in a folder.
    hidden
        Causes that are hidden in it; None where that is not known.
    """

    kind: str
    key: str
    make: Callable[[Path], Study]
    hidden: tuple[str, ...] | None = None


def studies(shared: Path) -> list[Frozen]:
    """Every study, kinds in turn, so that any beginning of the list holds some of each.

    Parameters
    ----------
    shared
        Folder of the measured data.
    """
    walks = Walks(strength=False)
    queues = {
        "free": _of("free", Free(), Free().plan(SEED)),
        "driven": _driven(),
        "imposed": _of("imposed", Imposed(), _imposed()),
        "contrast": _of("contrast", Pairs(), Pairs().plan(SEED)),
        "walking": _of("walking", walks, walks.plan(SEED)),
        "measured": _measured(shared),
    }
    rows = [list(islice(queue, COUNTS.get(kind))) for kind, queue in queues.items()]
    longest = max(len(row) for row in rows)
    spread = [((k + 0.5) / len(row) * longest, one) for row in rows for k, one in enumerate(row)]
    return [one for _, one in sorted(spread, key=lambda pair: pair[0])]


def _of(kind: str, generator: Generator, items: Iterable[Item]) -> Iterator[Frozen]:
    for item in items:
        yield Frozen(kind, item.key, partial(_made, generator, item), item.hidden)


def _made(generator: Generator, item: Item, folder: Path) -> Study:
    return generator.make(item, folder)[0]


def _driven() -> Iterator[Frozen]:
    """Of five generators in turn, each with its own causes in turn."""
    causes = {name: cycle(rows(name)) for name in DRIVEN}
    for k, name in enumerate(cycle(DRIVEN)):
        generator = Driven(name)
        yield from _of("driven", generator, [generator.item(next(causes[name]), SEED + k)])


def _imposed() -> Iterator[Item]:
    every = zip(*(cycle(Imposed().rows(rig)) for rig in RIGS), strict=False)
    pairs = chain.from_iterable(zip(RIGS, hidden, strict=True) for hidden in every)
    for k, (rig, hidden) in enumerate(pairs):
        yield Imposed().item(rig, hidden, SEED + k)


def _measured(shared: Path) -> Iterator[Frozen]:
    folders = [shared / "data" / name for name in MEASURED]
    folders += [one for name in PRACTICE for one in sorted((shared / name).iterdir())]
    for folder in folders:
        if (folder / "study.toml").exists():
            yield Frozen("measured", f"{folder.parent.name}-{folder.name}", partial(_read, folder))


def _read(folder: Path, _: Path) -> Study:
    return read_study(folder)
