"""How often a misread load is found, with an interval that covers it, and how often one is found where none was.

    .venv/bin/python scripts/benchmarks/misread.py [--count 20] [--seed 0]

Ankle studies of `scripts/accuracy contrast` in white, first-order autoregressive and random-torque
noise; every other one has trials whose strength scatters by 0.3 %. Each is tried as it is, and with one motion that
states a load 5 to 30 % off, either way.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from contrast_pairs.free import free_pair

from fes_pin.data.study import Study
from fes_pin.diagnosis.misread import find_misread
from fes_pin.infer.levels import CONFIDENCE_95
from fes_pin.models.nominal import nominal_model


def misread(study: Study, rng: np.random.Generator) -> tuple[Study, str, float]:
    """The study with one load stated wrong, the trial, and its true load, kg."""
    loaded = [t for t in study.trials if t.conditions.get("load_kg", 0.0) > 0.0]
    odd = loaded[int(rng.integers(len(loaded)))]
    true = odd.conditions["load_kg"]
    stated = true * (1.0 + float(rng.choice((-1.0, 1.0)) * rng.uniform(0.05, 0.3)))
    trials = [replace(t, conditions={**t.conditions, "load_kg": stated}) if t is odd else t for t in study.trials]
    return replace(study, trials=tuple(trials)), odd.name, true


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=20, help="studies, each with and without a misread load")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    right, covered, alarms = 0, 0, 0
    for seed in range(given.seed, given.seed + given.count):
        with tempfile.TemporaryDirectory(prefix="misread") as folder:
            study = free_pair("ankle", (), 80.0, seed, Path(folder))
        alarms += find_misread(nominal_model(study), study.trials) is not None
        wrong, name, true = misread(study, np.random.default_rng([seed, 79]))
        found = find_misread(nominal_model(wrong), wrong.trials)
        if found is None or (found.trial, found.condition) != (name, "load_kg"):
            print(f"  seed {seed}: trial {name} is missed, {found.words if found else 'nothing is found'}")
            continue
        right += 1
        covered += abs(found.value - true) < CONFIDENCE_95 * found.std
    print(
        f"{given.count} misread loads: trial right {right}, interval covers {covered}; alarms {alarms} of {given.count}"
    )


if __name__ == "__main__":
    main()
