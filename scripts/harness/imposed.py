"""Rigs whose motion is imposed: `imposed_rigs`."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle
from pathlib import Path

import numpy as np
from imposed_rigs import ankle, joint, muscle

import fes_pin as fp
from harness.generator import Item, Truth

RIGS = {"joint": joint, "muscle": muscle, "ankle": ankle}
SIZE = 0.3
"""Of what is hidden, as a share of the effort."""
WITH = {"series_elasticity": ("force_velocity",)}
"""What is hidden with a cause that shows nothing alone; see `imposed_rigs.muscle.study`."""


class Imposed:
    """Every cause in turn, nothing in every fourth."""

    ask = staticmethod(fp.diagnose)

    def plan(self, seed: int) -> Iterator[Item]:
        every = ((rig, hidden) for rig in RIGS for hidden in self.rows(rig))
        for k, (rig, hidden) in enumerate(cycle(every)):
            yield self.item(rig, hidden, seed + k)

    def rows(self, rig: str) -> Iterator[tuple[str, ...]]:
        """What is hidden in the studies of a rig in turn."""
        for k, cause in enumerate(RIGS[rig].CAUSES):
            yield (cause, *WITH.get(cause, ()))
            if k % 3 == 2:
                yield ()

    def item(self, rig: str, hidden: tuple[str, ...], seed: int) -> Item:
        """The study of a rig and a seed that hides these causes."""
        return Item(f"{rig}-{seed}", seed, hidden, rig)

    def make(self, item: Item, folder: Path) -> tuple[fp.Study, Truth]:
        rng = np.random.default_rng(item.seed)
        return RIGS[item.part].study(item.hidden[:1], SIZE, rng, folder / "study"), Truth()
