"""A diagnosis of 500 trials: time and memory, and the size of its report.

.venv/bin/python scripts/benchmarks/show.py large
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from fes_pin.data.study import read_study, write_study
from fes_pin.models.effects import CoulombFriction
from fes_pin.models.nominal import nominal_model
from fes_pin.models.simulate import simulate

STUDY = Path(__file__).parents[2] / "analysis" / "studies" / "ankle_demo"
TRIALS = 500


def run() -> list[tuple[str, float, float | None, str]]:
    """Rows of (name, measured, target, unit)."""
    study = read_study(STUDY)
    model, rng = nominal_model(study) + CoulombFriction(torque_nm=0.01), np.random.default_rng(0)
    trials = []
    for k in range(TRIALS):
        trial = study.trials[k % len(study.trials)]
        made = simulate(model, trial)
        noise = {n: (1e-3 if n == "angle_rad" else 0.05) for n in model.rig.outputs(trial.kind)}
        read = {n: made[n] + std * rng.standard_normal(len(trial)) for n, std in noise.items()}
        trials.append(replace(trial.with_columns(**read), name=f"t{k:03d}"))
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        write_study(replace(study, name="large", trials=tuple(trials)), place / "in")
        command = [
            str(Path(sys.executable).parent / "fes-pin"),
            "diagnose",
            str(place / "in"),
            "--out",
            str(place / "out"),
        ]
        began = time.perf_counter()
        subprocess.run(command, capture_output=True, check=True)
        wall = time.perf_counter() - began
        size = (place / "out/report.html").stat().st_size / 1e6
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return [
        (f"{TRIALS} trials: wall", wall, 300.0, "s"),
        (f"{TRIALS} trials: processor", used.ru_utime + used.ru_stime, None, "s"),
        ("greatest memory", used.ru_maxrss / 2**20, 2.0, "GiB"),
        ("report", size, None, "MB"),
    ]
