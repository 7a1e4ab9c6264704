"""Studies of others whose answers lie beside them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import fes_pin as fp
from fes_pin.models.catalogue import shipped
from harness.generator import MISREAD, Item, Truth


class Practice:
    """A folder of studies with `answers/STUDY/answer.json` among them."""

    ask = staticmethod(fp.diagnose)

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def plan(self, seed: int) -> Iterator[Item]:
        known = {effect.name for effect in shipped().effects} | {MISREAD}
        for place in sorted(self.folder.glob("answers/*/answer.json"))[seed:]:
            hidden = tuple(json.loads(place.read_text())["causes"])
            yield Item(place.parent.name, 0, hidden, outside=bool(set(hidden) - known))

    def make(self, item: Item, folder: Path) -> tuple[fp.Study, Truth]:
        answer = json.loads((self.folder / "answers" / item.key / "answer.json").read_text())
        truth = {}
        if "true_inertia_scale" in answer:
            truth = {"inertia_scale": answer["true_inertia_scale"], "damping": answer["parameters"]["b"]}
        return fp.read_study(self.folder / item.key), Truth(truth)
