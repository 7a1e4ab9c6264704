"""Ankles, muscles and joints that are simulated freely: `confusion_matrix`."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from confusion_matrix import plan

import fes_pin as fp
from harness.generator import Item, Truth

BANDS = (25.0, 80.0)
"""d of a single cause as it came out, between those that the plan has."""


class Free:
    """One cause in each form, nothing, two, and what the library does not have."""

    ask = staticmethod(fp.diagnose)

    def plan(self, seed: int) -> Iterator[Item]:
        for one in chain.from_iterable(plan.groups(seed)):
            yield Item(one.name, one.seed, one.causes, outside=one.kind == "outside")

    def make(self, item: Item, folder: Path) -> tuple[fp.Study, Truth]:
        from confusion_matrix.generator import make  # noqa: PLC0415

        one = plan.Item.parse(item.key)
        made = make(one, folder)
        part = None
        if one.kind == "single":
            form = "the engine's form" if one.form == "same" else "another form"
            part = f"d = {plan.DISTANCES[bisect(BANDS, made.distances[0])]}, {form}"
        return made.study, Truth(made.truth, part=part)
