"""What folds choose again among the sets that were fitted, against a whole diagnosis without the fold's trials.

    .venv/bin/python scripts/benchmarks/folds.py [--count 20] [--distance 25] [--seed 0]

Ankles that hide one cause or nothing, of `scripts/accuracy free`. Printed are, over all folds of all
studies, how often both choose the named cause, only one does, or neither, and what either takes.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from confusion_matrix.generator import make
from confusion_matrix.plan import FORMS, Item

from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.prepare.measured import folds_of

NOISE = "white"


def drawn(count: int, distance: int, seed: int) -> list[Item]:
    """Singles in turn, every form of the engine's on the ankle."""
    causes = [f.cause for f in FORMS if f.name == "same" and "ankle" in f.rigs]
    return [Item("ankle", (causes[k % len(causes)],), "same", distance, NOISE, 1000 * seed + k) for k in range(count)]


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--distance", type=int, default=25)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    alike, once, again = Counter[str](), 0.0, 0.0
    with tempfile.TemporaryDirectory(prefix="folds") as folder:
        for item in drawn(given.count, given.distance, given.seed):
            study = make(item, Path(folder)).study
            began = time.perf_counter()
            whole = diagnose_joint(study)
            once += time.perf_counter() - began
            for cause in whole.causes:
                names = {cause.name, *cause.equivalents}
                began = time.perf_counter()
                nested = 0
                folds = folds_of(study.trials)
                for held in folds:
                    others = tuple(t for i, t in enumerate(study.trials) if i not in held)
                    found = diagnose_joint(replace(study, trials=others))
                    nested += any(names & {c.name, *c.equivalents} for c in found.causes)
                again += time.perf_counter() - began
                quick = cause.chosen_again[0] if cause.chosen_again else 0
                alike["both"] += min(quick, nested)
                alike["only among the sets"] += max(quick - nested, 0)
                alike["only the whole diagnosis"] += max(nested - quick, 0)
                alike["neither"] += len(folds) - max(quick, nested)
                print(f"{item.name}: {cause.name} {quick} and {nested} of {len(folds)} folds", flush=True)
    print(", ".join(f"{n}: {alike[n]}" for n in ("both", "only among the sets", "only the whole diagnosis", "neither")))
    print(f"one diagnosis of each study {once:.0f} s, whole diagnoses again in their folds {again:.0f} s")


if __name__ == "__main__":
    main()
