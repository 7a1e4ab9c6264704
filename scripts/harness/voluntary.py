"""Limbs that a dynamometer moves to and fro, of subjects who relax or do not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
from imposed_rigs import joint
from imposed_rigs.motion import Motion, wandering

import fes_pin as fp
from harness.generator import Item, Truth

CAUSES = ((), ("coulomb_friction",), ("parallel_stiffness",), ("quadratic_damping",), ("passive_relaxation",))
SIZE, OWN = 0.4, (0.2, 0.6)
"""Of a cause, and of the voluntary effort, as shares of the effort; a fifth is what a passive limb does not vary by."""
CYCLES_HZ, SECONDS, EVERY = (0.4, 1.0), 20.0, 5
"""Rates of the cycles, 8 to 20 of them in a trial; every so many samples of a stand's are kept, 100 a second."""
RELAXED, VOLUNTARY = "relaxed", "voluntary"


class Voluntary:
    """A voluntary effort in every second study, with a cause or alone; it wanders about what the subject holds."""

    ask = staticmethod(fp.diagnose)

    def plan(self, seed: int) -> Iterator[Item]:
        for k in count(seed):
            hidden, part = CAUSES[k // 2 % len(CAUSES)], VOLUNTARY if k % 2 else RELAXED
            yield Item(f"{part}-{k}", k, hidden, part, outside=part == VOLUNTARY and not hidden)

    def make(self, item: Item, folder: Path) -> tuple[fp.Study, Truth]:
        rng = np.random.default_rng([item.seed, 11])
        made = joint.study(item.hidden, SIZE, rng, folder / "study", cycles, SECONDS)
        usual = float(np.sqrt(np.mean([np.mean(t["effort"] ** 2) for t in made.trials])))
        size = usual * rng.uniform(*OWN) * (item.part == VOLUNTARY)
        trials = []
        for trial in (t.part(slice(None, None, EVERY)) for t in made.trials):
            held, time_s = rng.uniform(0.0, 2.0) * size, rng.uniform(0.3, 1.5)
            own = held + wandering(len(trial), trial.dt, size, time_s, rng)
            trials.append(trial.with_columns(effort=trial["effort"] + own))
        return replace(made, trials=tuple(trials)), Truth()


def cycles(centre: float, reach: float, slowest_hz: float, fastest_hz: float, rng: np.random.Generator) -> Motion:
    """A motion that repeats itself: a sine with two harmonics."""
    rates = 2.0 * np.pi * rng.uniform(*CYCLES_HZ) * np.array([1.0, 2.0, 3.0])
    sizes = np.array([1.0, rng.uniform(0.0, 0.3), rng.uniform(0.0, 0.1)])
    return Motion(centre, reach * sizes / sizes.sum(), rates, rng.uniform(0.0, 2.0 * np.pi, size=3))
