"""How far a right model's residual lies above the noise from sample to sample, and how often a gate there is wrong.

    .venv/bin/python scripts/benchmarks/adequate.py [--count 40] [--seed 0]

Studies that hide nothing, of `scripts/accuracy free`, in white, first-order autoregressive (0.6 to 0.9) and coloured
noise (a random torque, or ARMA(2, 1) in the sensor), are fitted with the nominal model. Printed are quantiles of
`rejected.slowness`, and how many studies lie beyond `levels.SMALL_SHARE`, where no model is adequate.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from confusion_matrix.generator import make
from confusion_matrix.noise import FAMILIES
from confusion_matrix.plan import Item

from fes_pin.diagnosis.rejected import slowness
from fes_pin.infer.levels import SMALL_SHARE
from fes_pin.models.nominal import nominal_model
from fes_pin.search.fit import fit


def ratios(rig: str, noise: str, count: int, seed: int) -> np.ndarray:
    """`slowness` of the nominal fits of so many studies, shape (count,)."""
    items = [Item(rig, (), "null", 0, noise, 1000 * seed + k) for k in range(count)]
    found = []
    with tempfile.TemporaryDirectory(prefix="adequate") as folder:
        for item in items:
            made = make(item, Path(folder))
            found.append(max(slowness(fit(nominal_model(made.study), made.study.trials)).values()))
    return np.array(found)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=40, help="studies of each rig and kind of noise")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    beyond_all = f"> {1.0 / SMALL_SHARE:g}"
    print(f"{'rig':8s}{'noise':10s}{'studies':>8s}{'median':>8s}{'95 %':>8s}{'largest':>8s}{beyond_all:>8s}")
    for rig in ("ankle", "joint", "muscle"):
        for noise in FAMILIES:
            r = ratios(rig, noise, given.count, given.seed)
            beyond = int(np.count_nonzero(SMALL_SHARE * r > 1.0))
            print(
                f"{rig:8s}{noise:10s}{len(r):8d}{np.median(r):8.2f}{np.quantile(r, 0.95):8.2f}{r.max():8.2f}{beyond:8d}"
            )


if __name__ == "__main__":
    main()
