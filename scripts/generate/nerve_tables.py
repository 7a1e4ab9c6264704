"""Write muscles.csv, trunk.csv and strengths.csv in fes_pin/muscles/tables.

The source model's fibre and tendon lengths are those of its unscaled form, while its paths are scaled to a subject:
they are scaled here as the paths are, muscle by muscle. Strengths get one factor a nerve, so that maximal joint torques
agree with those that people make (`analysis/yardsticks/strength.py`).
The measured data is not in the repository; it lies in FES_PIN_DATA or in `shared` beside the repository.
Run: python scripts/generate/nerve_tables.py
"""

from __future__ import annotations

import csv
import math
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import nnls

from fes_pin.muscles.muscles import standard_muscles
from fes_pin.muscles.nerves import SUBJECT_HEIGHT, SUBJECT_MASS
from fes_pin.muscles.paths import COORDINATES, leg_paths

sys.path.insert(0, str(Path(__file__).parents[2] / "analysis"))
from yardsticks.strength import ANDERSON_2007, muscle_torques

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("FES_PIN_DATA", ROOT.parent / "shared"))
SOURCE = (DATA if (DATA / "nerve_moment_arms").is_dir() else DATA / "data") / "nerve_moment_arms"
TABLES = ROOT / "fes_pin" / "muscles" / "tables"
SCALES = {
    "pelvis": 1.02457704,
    "femur": 1.14724,
    "tibia": 0.988523,
    "talus": 1.11397808,
    "calcaneus": 1.02708,
    "toes": 1.02708,
}
"""The subject's bodies over the unscaled model's (its joints and meshes; the toes as the calcaneus)."""
NERVES = {
    "superior_gluteal": "superior_gluteal",
    "inferior_gluteal": "inferior_gluteal",
    "sciatic_tibial_div_hamstrings": "hamstrings",
    "common_peroneal(sciatic) bfsh": "biceps_short_head",
    "femoral": "femoral",
    "femoral_or_obturator pectineus": "femoral",
    "obturator(+sciatic part of add_mag)": "obturator",
    "lumbar_plexus/femoral iliopsoas": "iliopsoas",
    "sacral_plexus rotators": "sacral_rotators",
    "tibial": "tibial",
    "deep_peroneal": "deep_peroneal",
    "superficial_peroneal": "superficial_peroneal",
}
TRUNK = {
    "ercspn": ("erector_spinae", {"lumbar_extension": 55, "lumbar_bending": 35}),
    "extobl": ("abdominals", {"lumbar_extension": -30, "lumbar_bending": 100, "lumbar_rotation": 60}),
    "intobl": ("abdominals", {"lumbar_extension": -30, "lumbar_bending": 90, "lumbar_rotation": -60}),
}
"""Levers (mm), rounded from the literature named in tables/SOURCE.md; right side."""
FITTED = (
    ("inferior_gluteal", "superior_gluteal", "obturator", "iliopsoas", "sacral_rotators"),
    ("hamstrings", "biceps_short_head"),
    ("femoral",),
    ("tibial",),
    ("deep_peroneal",),
)
"""Nerves whose strength the published curves decide, those of one group by one factor (the curves do not tell the
nerves of the hip apart); all others keep theirs."""


def write(name: str, header: list[str], rows: list[list]) -> None:
    """One table, comma separated."""
    with (TABLES / name).open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)


def growth() -> dict[str, float]:
    """How much longer each leg muscle is in the subject than in the unscaled model, at the neutral posture."""
    subject, neutral = leg_paths(), np.zeros((1, len(COORDINATES)))
    unscaled = replace(subject, size={**subject.size, **{body: 1.0 / scale for body, scale in SCALES.items()}})
    return dict(zip(subject.names, (subject.lengths(neutral) / unscaled.lengths(neutral))[0], strict=True))


def write_muscles() -> list[str]:
    """muscles.csv and trunk.csv; the nerves in their order."""
    grown, muscles, nerves = growth(), [], []
    with (SOURCE / "gait2392_subject01_moment_arms.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["posture"] == "neutral"]
    for row in rows:
        name = row["muscle"].removesuffix("_r")
        nerve = TRUNK[name][0] if name in TRUNK else NERVES[row["nerve_group"]]
        fibre, tendon = (1e3 * float(row[key]) * grown.get(name, 1.0) for key in ("lopt_m", "ltslack_m"))
        lengths = [f"{fibre:.1f}", f"{tendon:.1f}", f"{1e3 * float(row['lmt_m']):.1f}"]
        pennation = f"{math.degrees(float(row['penn_rad'])):.1f}"
        muscles.append([name, nerve, f"{float(row['Fmax_N']):.0f}", *lengths, pennation])
        nerves.append(nerve)
    header = ["muscle", "nerve", "strength_N", "fibre_mm", "tendon_mm", "neutral_length_mm", "pennation_deg"]
    write("muscles.csv", header, muscles)
    levers = [[name, joint, lever] for name, (_, each) in TRUNK.items() for joint, lever in each.items()]
    write("trunk.csv", ["muscle", "joint", "lever_mm"], levers)
    return list(dict.fromkeys(nerves))


def write_strengths(nerves: list[str], factors: dict[str, float]) -> None:
    """strengths.csv."""
    write("strengths.csv", ["nerve", "factor"], [[nerve, f"{factors.get(nerve, 1.0):.2f}"] for nerve in nerves])
    standard_muscles.cache_clear()


def fitted() -> dict[str, float]:
    """Factors that bring the table's torques nearest to the published ones, all curves relative to their peaks."""
    table, design, wanted = standard_muscles(), [], []
    owners = [next((k for k, g in enumerate(FITTED) if n.removeprefix("left_") in g), None) for n in table.nerves]
    for curve in ANDERSON_2007.values():
        angles = curve.angles_deg()
        each = np.maximum(muscle_torques(table, curve, angles), 0.0)
        target = curve.torque_nm(angles, SUBJECT_MASS, SUBJECT_HEIGHT)
        columns = [each[:, [o == k for o in owners]].sum(1) for k in range(len(FITTED))]
        rest = each[:, [o is None for o in owners]].sum(1)
        design.append(np.array(columns).T / target.max())
        wanted.append((target - rest) / target.max())
    factors = nnls(np.concatenate(design), np.concatenate(wanted))[0]
    return {nerve: float(factor) for group, factor in zip(FITTED, factors, strict=True) for nerve in group}


def main() -> None:
    """Write the tables."""
    nerves = write_muscles()
    write_strengths(nerves, {})
    write_strengths(nerves, fitted())


if __name__ == "__main__":
    main()
