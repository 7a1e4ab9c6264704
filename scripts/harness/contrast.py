"""Pairs of groups of trials between which something was changed: `contrast_pairs`."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from itertools import count
from pathlib import Path

import numpy as np
from contrast_pairs import driven, free, practice

import fes_pin as fp
from harness.generator import Item, Truth, shared

RIGS = ("ankle", "ankle", "driven", "muscle", "ankle", "joint", "driven", "ankle")
"""In turn."""
DISTANCE, SHARE = 80.0, 0.4
"""d of a cause if all trials had it; of driven rigs its torque as a share of the effort."""


class Pairs:
    """Nothing changed in every third, two things in every ninth, else one."""

    ask = staticmethod(fp.contrast)

    def plan(self, seed: int) -> Iterator[Item]:
        for k in count(seed):
            rng = np.random.default_rng([k, 76])
            rig = RIGS[k % len(RIGS)]
            names = (*(driven.NOMINAL if rig == "driven" else free.NOMINAL[rig]),)
            names += driven.CAUSES if rig == "driven" else free.CAUSES[rig]
            wanted = 0 if k % 3 == 0 else 2 if k % 9 == 4 else 1
            yield Item(f"{rig}-{k}", k, tuple(str(n) for n in rng.choice(names, wanted, replace=False)), rig)

    def make(self, item: Item, folder: Path) -> tuple[fp.Study, Truth]:
        if item.part == "driven":
            return driven.driven_pair(item.hidden, SHARE, item.seed, folder), Truth()
        return free.free_pair(item.part, item.hidden, DISTANCE, item.seed, folder), Truth()


class Halved:
    """Every study of `practice` in the folder of measured data twice: as it is, and with a change in one half."""

    ask = staticmethod(fp.contrast)

    def plan(self, seed: int) -> Iterator[Item]:
        for k, place in enumerate(sorted((shared() / "practice").glob("*/study.toml"))[seed:]):
            rig = tomllib.loads(place.read_text())["study"]["rig"]
            yield Item(place.parent.name, k, (), rig)
            if exact := practice.EXACT.get(rig):
                yield Item(f"{place.parent.name}-changed", k, (exact[k % len(exact)],), rig)

    def make(self, item: Item, folder: Path) -> tuple[fp.Study, Truth]:
        study = fp.read_study(shared() / "practice" / item.key.removesuffix("-changed"))
        return practice.practice_pair(study, item.hidden), Truth()
