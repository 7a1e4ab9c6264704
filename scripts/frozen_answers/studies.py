"""The studies whose answers are frozen: free and driven rigs, imposed motion, contrasts, walks, and measured data."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import chain, cycle, islice
from pathlib import Path
from typing import Any

import numpy as np
from confusion_matrix.generator import make as make_free
from confusion_matrix.runner import plan as free_plan
from contrast_pairs.__main__ import plan as contrast_plan
from contrast_pairs.driven import driven_pair
from contrast_pairs.free import free_pair
from driven_rigs import laboratory, stimulated, swing_up
from driven_rigs.__main__ import items as driven_items
from driven_rigs.draw import draw
from imposed_rigs.__main__ import RIGS as IMPOSED
from imposed_rigs.__main__ import items as imposed_items
from walking_matrix.plan import KINDS, drawn
from walking_matrix.synthetic import gait_of
from walking_matrix.synthetic import make as make_walk

from fes_pin.body.measured_walk import data_folder
from fes_pin.data.study import Study, read_study

SEED = 9_127_000
"""Of the first study of each generator. No rule was ever made or tried on these seeds."""
COUNTS = {"free": 120, "driven": 60, "imposed": 40, "contrast": 30, "walking": 20}
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
    queues = [_free(), _driven(), _imposed(), _contrasts(), _walks(), _measured(shared)]
    rows = [list(queue) for queue in queues]
    longest = max(len(row) for row in rows)
    spread = [((k + 0.5) / len(row) * longest, one) for row in rows for k, one in enumerate(row)]
    return [one for _, one in sorted(spread, key=lambda pair: pair[0])]


def _free() -> Iterator[Frozen]:
    for item in chain.from_iterable(free_plan(COUNTS["free"], SEED)):
        yield Frozen("free", item.name, partial(_made_free, item), item.causes)


def _made_free(item: Any, folder: Path) -> Study:
    return make_free([item], folder)[0].study


def _driven() -> Iterator[Frozen]:
    drawing = {
        "plain": (lambda causes, k, folder: draw(causes, 0.3, k, folder, False, None, 1), None),
        "recorded": (lambda causes, k, folder: draw(causes, 0.3, k, folder, True, None, 1), None),
        "laboratory": (laboratory.draw_laboratory, laboratory),
        "swing_up": (swing_up.draw_swing_up, swing_up),
        "stimulated": (stimulated.draw_stimulated, stimulated),
    }
    causes = {name: cycle(driven_items(COUNTS["driven"], module)) for name, (_, module) in drawing.items()}
    for k, name in enumerate(islice(cycle(drawing), COUNTS["driven"])):
        hidden = next(causes[name])
        yield Frozen("driven", f"{name}-{SEED + k}", partial(_made_driven, drawing[name][0], hidden, SEED + k), hidden)


def _made_driven(drawing: Any, causes: tuple[str, ...], seed: int, folder: Path) -> Study:
    return read_study(drawing(causes, seed, folder).study)


def _imposed() -> Iterator[Frozen]:
    every = [list(imposed_items(COUNTS["imposed"], rig)) for rig in IMPOSED]
    for k, (rig, cause) in enumerate(islice(chain.from_iterable(zip(*every, strict=True)), COUNTS["imposed"])):
        hidden = (cause,) if cause else ()
        yield Frozen("imposed", f"{rig}-{SEED + k}", partial(_made_imposed, rig, hidden, SEED + k), hidden)


def _made_imposed(rig: str, causes: tuple[str, ...], seed: int, folder: Path) -> Study:
    return IMPOSED[rig].study(causes, 0.3, np.random.default_rng(seed), folder / "study")


def _contrasts() -> Iterator[Frozen]:
    for seed, rig, changes in contrast_plan(COUNTS["contrast"], SEED, nulls=False):
        yield Frozen("contrast", f"{rig}-{seed}", partial(_made_pair, rig, changes, seed), changes)


def _made_pair(rig: str, changes: tuple[str, ...], seed: int, folder: Path) -> Study:
    if rig == "driven":
        return driven_pair(changes, 0.4, seed, folder)
    return free_pair(rig, changes, 80.0, seed, folder)


def _walks() -> Iterator[Frozen]:
    for k in range(COUNTS["walking"]):
        kind = "none" if k % 4 == 3 else KINDS[(k - k // 4) % len(KINDS)]
        hidden = () if kind == "none" else (kind,)
        yield Frozen("walking", f"{kind}-{SEED + k}", partial(_made_walk, kind, SEED + k), hidden)


def _made_walk(kind: str, seed: int, folder: Path) -> Study:
    make_walk(gait_of(data_folder()), folder, drawn(kind, seed), seed)
    return read_study(folder)


def _measured(shared: Path) -> Iterator[Frozen]:
    folders = [shared / "data" / name for name in MEASURED]
    folders += [one for name in PRACTICE for one in sorted((shared / name).iterdir())]
    for folder in folders:
        if (folder / "study.toml").exists():
            yield Frozen("measured", f"{folder.parent.name}-{folder.name}", partial(_read, folder))


def _read(folder: Path, _: Path) -> Study:
    return read_study(folder)
