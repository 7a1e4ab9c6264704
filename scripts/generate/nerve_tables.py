"""Write the rounded tables in fes_pin/muscles/tables from the measured moment arms.

The measured data is not in the repository; it lies in FES_PIN_DATA or in `shared` beside the repository.
Run: python scripts/generate/nerve_tables.py
"""

from __future__ import annotations

import csv
import json
import math
import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("FES_PIN_DATA", ROOT.parent / "shared"))
SOURCE = (DATA if (DATA / "nerve_moment_arms").is_dir() else DATA / "data") / "nerve_moment_arms"
TABLES = ROOT / "fes_pin" / "muscles" / "tables"
POSTURES = ["neutral", "mid_stance", "mid_swing", "push_off"]
# the measured model's coordinate -> this project's joint, and the sign between them (the model's knee extends positive)
JOINTS = {
    "hip_flexion": ("hip_flexion", 1),
    "hip_adduction": ("hip_adduction", 1),
    "hip_rotation": ("hip_rotation", 1),
    "knee_angle": ("knee_flexion", -1),
    "ankle_angle": ("ankle_dorsiflexion", 1),
    "subtalar_angle": ("ankle_inversion", 1),
    "mtp_angle": ("mtp_extension", 1),
}
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
# Trunk: strengths from the same model, levers (mm) rounded from the literature named in tables/SOURCE.md; right side.
TRUNK = {
    "ercspn": ("erector_spinae", {"lumbar_extension": 55, "lumbar_bending": 35}),
    "extobl": ("abdominals", {"lumbar_extension": -30, "lumbar_bending": 100, "lumbar_rotation": 60}),
    "intobl": ("abdominals", {"lumbar_extension": -30, "lumbar_bending": 90, "lumbar_rotation": -60}),
}
LEAST_ARM_MM = 0.05


def read_measured() -> tuple[dict[str, dict[str, dict[str, str]]], dict]:
    """Rows by muscle and posture, and the postures' angles."""
    rows: dict[str, dict[str, dict[str, str]]] = {}
    with (SOURCE / "gait2392_subject01_moment_arms.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            rows.setdefault(row["muscle"].removesuffix("_r"), {})[row["posture"]] = row
    postures = json.loads((SOURCE / "postures.json").read_text())
    return rows, next(iter(postures.values()))


def write(name: str, header: list[str], rows: list[list]) -> None:
    """One table, comma separated."""
    with (TABLES / name).open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)


def main() -> None:
    """Write muscles.csv, moment_arms.csv and postures.csv."""
    measured, angles = read_measured()
    muscles, arms = [], []
    for muscle, by_posture in measured.items():
        row = by_posture["neutral"]
        nerve, levers = TRUNK.get(muscle, (NERVES.get(row["nerve_group"]), {}))
        lengths = [f"{1e3 * float(row[key]):.0f}" for key in ("lopt_m", "ltslack_m", "lmt_m")]
        muscles.append(
            [
                muscle,
                nerve,
                f"{float(row['Fmax_N']):.0f}",
                *lengths,
                f"{math.degrees(float(row['penn_rad'])):.0f}",
            ]
        )
        arms += [[muscle, joint, *[f"{lever:.1f}"] * len(POSTURES)] for joint, lever in levers.items()]
        for coordinate, (joint, sign) in JOINTS.items():
            values = [sign * 1e3 * float(by_posture[p][f"r_{coordinate}_r_m"]) for p in POSTURES]
            if max(map(abs, values)) > LEAST_ARM_MM:
                arms.append([muscle, joint, *(f"{v:.1f}" for v in values)])
    write(
        "muscles.csv",
        ["muscle", "nerve", "strength_N", "fibre_mm", "tendon_mm", "neutral_length_mm", "pennation_deg"],
        muscles,
    )
    write("moment_arms.csv", ["muscle", "joint", *(f"{p}_mm" for p in POSTURES)], arms)
    write(
        "postures.csv",
        ["joint", *(f"{p}_deg" for p in POSTURES)],
        [
            [joint, *(f"{0.0 + sign * math.degrees(angles[p].get(coordinate + '_r', 0.0)):.1f}" for p in POSTURES)]
            for coordinate, (joint, sign) in JOINTS.items()
        ],
    )


if __name__ == "__main__":
    main()
