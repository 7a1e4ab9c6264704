"""Ankles by the likelihood of a rig with a random effort, and by free simulation: what either search finds.

    .venv/bin/python scripts/benchmarks/ways.py [--count 24] [--distance 25] [--seed 0]

Ankles that hide one cause or nothing, made without the engine (`scripts/accuracy free`), in white, autoregressive and
process noise in turn. Counted is in how many the cause stands in the first set, and alone, before trials are held out.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from confusion_matrix.generator import make
from confusion_matrix.noise import FAMILIES
from confusion_matrix.plan import FORMS, Item

from fes_pin.data.study import Study
from fes_pin.diagnosis.decide.rivals import alternatives
from fes_pin.diagnosis.diagnosis import split
from fes_pin.diagnosis.searches import Searches
from fes_pin.infer.search import SearchResult
from fes_pin.models.catalogue import shipped
from fes_pin.models.nominal import nominal_model

NULLS = 6
"""One study in so many hides nothing."""


def drawn(count: int, distance: int, seed: int) -> list[Item]:
    """Nothing, then forms of the engine's on the ankle in turn."""
    causes = [f.cause for f in FORMS if f.name == "same" and "ankle" in f.rigs]
    hidden = [(causes[k % len(causes)],) if k % NULLS else () for k in range(count)]
    return [
        Item(
            "ankle",
            names,
            "same" if names else "null",
            distance,
            FAMILIES[(k + k // NULLS) % len(FAMILIES)],
            1000 * seed + k,
        )
        for k, names in enumerate(hidden)
    ]


def sets_of(study: Study, driven: bool) -> list[tuple[str, ...]]:
    """What a search finds: every cause with what cannot be told from it."""
    nominal, (train, test) = nominal_model(study), split(study)
    effects = shipped().effects_for(nominal.rig)
    _, found = Searches(nominal, train, train, test, driven, effects, 0, lambda *_: None, None).run(train)
    best = found.best if isinstance(found, SearchResult) else found.judged
    return [(e.name, *alternatives(best, found.rivals[e.name], e.name)) for e in best.model.effects]


def told(hidden: Sequence[str], sets: Sequence[tuple[str, ...]]) -> list[str]:
    """What is counted of one answer."""
    if not hidden:
        return ["nulls", "nulls with a name"] if sets else ["nulls"]
    found = any(set(hidden) <= set(names) for names in sets)
    alone = [tuple(hidden)] == list(sets)
    return ["hidden", *["in a first set"] * found, *["alone"] * alone, *["with a further name"] * (len(sets) > 1)]


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--distance", type=int, default=25)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    ways = {"free simulation": False, "likelihood": True}
    counts, seconds = {way: Counter[str]() for way in ways}, Counter[str]()
    with tempfile.TemporaryDirectory(prefix="ways") as folder:
        for item in drawn(given.count, given.distance, given.seed):
            study = make(item, Path(folder)).study
            for way, driven in ways.items():
                began = time.perf_counter()
                sets = sets_of(study, driven)
                seconds[way] += time.perf_counter() - began
                counts[way].update(told(item.causes, sets))
                print(f"{item.name}: {way}: {sets}", flush=True)
    for way in ways:
        print(f"{way}: {dict(sorted(counts[way].items()))}, {seconds[way]:.0f} s")


if __name__ == "__main__":
    main()
