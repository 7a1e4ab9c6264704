"""Ankles of which one trial states a load that it did not have."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
from contrast_pairs.free import free_pair

import fes_pin as fp
from harness.generator import MISREAD, Item, Truth

OFF = (0.05, 0.3)
"""How far a load is stated off, as a share of what it is."""


class Misread:
    """Every other study states all loads as they are; in every second pair repeats scatter by 0.3 %."""

    ask = staticmethod(fp.diagnose)

    def plan(self, seed: int) -> Iterator[Item]:
        for k in count(seed):
            yield Item(f"right-{k}", k)
            yield Item(f"misread-{k}", k, (MISREAD,))

    def make(self, item: Item, folder: Path) -> tuple[fp.Study, Truth]:
        pair = free_pair("ankle", (), 80.0, item.seed, folder)
        study = replace(pair, trials=tuple(replace(t, group=None) for t in pair.trials))
        if not item.hidden:
            return study, Truth()
        rng = np.random.default_rng([item.seed, 79])
        loaded = [t for t in study.trials if t.conditions.get("load_kg", 0.0) > 0.0]
        odd = loaded[int(rng.integers(len(loaded)))]
        true = odd.conditions["load_kg"]
        stated = true * (1.0 + float(rng.choice((-1.0, 1.0)) * rng.uniform(*OFF)))
        trials = [replace(t, conditions={**t.conditions, "load_kg": stated}) if t is odd else t for t in study.trials]
        return replace(study, trials=tuple(trials)), Truth({f"{MISREAD} at {odd.name}": true})
