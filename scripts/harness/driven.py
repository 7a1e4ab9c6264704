"""Rigs that a controller drives: `driven_rigs`."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle
from pathlib import Path

from driven_rigs import arm, draw, laboratory, no_form, stimulated, swing_up

import fes_pin as fp
from harness.generator import Item, Truth

SIZE = 0.3
"""Torque of what is hidden, as a share of the effort."""
RECORDINGS = {
    "plain": draw.Recording(),
    "recorded": draw.Recording(True),
    "play": draw.Recording(True),
    "low-passed": draw.Recording(True, 20.0),
    "every-fifth": draw.Recording(True, None, 5),
}
"""How the rigs of the first generator are recorded."""
OTHERS = {
    "laboratory": (laboratory, laboratory.draw_laboratory),
    "swing-up": (swing_up, swing_up.draw_swing_up),
    "arm": (arm, arm.draw_arm),
    "stimulated": (stimulated, stimulated.draw_stimulated),
    "no-form": (no_form, no_form.draw_no_form),
}
"""Generators with causes and dynamics of their own."""
OUTSIDE = {*draw.OUTSIDE, *stimulated.OUTSIDE}


def rows(name: str) -> list[tuple[str, ...]]:
    """What is hidden in turn: nothing, every cause, pairs, and something else."""
    if name == "play":
        others = [(c, "backlash") for c in draw.CAUSES if c != "backlash"]
        return [(), ("backlash",), *others]
    if name in OTHERS:
        own = OTHERS[name][0]
        outside = [(c,) for c in getattr(own, "OUTSIDE", ())]
        return [(), *((c,) for c in own.CAUSES), (), own.CAUSES[:1], *own.PAIRS, *outside]
    singles = [(c,) for c in draw.CAUSES]
    return [(), *singles[:5], (), *singles[5:], *draw.PAIRS[:2], (), draw.OUTSIDE, *draw.PAIRS[2:]]


class Driven:
    """One cause, two, nothing, and what the library does not have.

    Parameters
    ----------
    name
        Of a way to record the first generator's rigs, or of another generator.
    """

    ask = staticmethod(fp.diagnose)

    def __init__(self, name: str) -> None:
        self.name = name

    def plan(self, seed: int) -> Iterator[Item]:
        for k, hidden in enumerate(cycle(rows(self.name))):
            yield self.item(hidden, seed + k)

    def item(self, hidden: tuple[str, ...], seed: int) -> Item:
        """The study of a seed that hides these causes."""
        return Item(f"{self.name.replace('-', '_')}-{seed}", seed, hidden, outside=bool(OUTSIDE & set(hidden)))

    def make(self, item: Item, folder: Path) -> tuple[fp.Study, Truth]:
        if self.name in OTHERS:
            drawn = OTHERS[self.name][1](item.hidden, item.seed, folder)
        else:
            way = RECORDINGS[self.name]
            drawn = draw.draw(item.hidden, SIZE, item.seed, folder, way.measured, way.cutoff_hz, way.every)
        truth = {n: float(v) for n, v in drawn.truth.items()}
        part = None if drawn.nearest is None else "".join(item.hidden)
        return fp.read_study(drawn.study), Truth(truth, drawn.beside, part, nearest=drawn.nearest)
