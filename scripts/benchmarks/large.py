"""A diagnosis of 500 trials, of 200 trials of 2000 samples, and of one of a million: time, memory, size of the report.

.venv/bin/python scripts/benchmarks/show.py large
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fes_pin.data.study import Study, read_study, write_study
from fes_pin.data.trial import Trial
from fes_pin.models.effects import CoulombFriction
from fes_pin.models.model import Model
from fes_pin.models.nominal import nominal_model
from fes_pin.models.simulate import simulate

STUDY = Path(__file__).parents[2] / "analysis" / "studies" / "ankle_demo"
FRICTION_NM = 0.01
MUCH_GIB = 2.0

Row = tuple[str, float, float | None, str]


def run() -> list[Row]:
    """Rows of (name, measured, target, unit)."""
    study = read_study(STUDY)
    moving = [t for t in study.trials if t.kind == "motion"]
    many = [study.trials[k % len(study.trials)] for k in range(500)]
    medium = [_as_long(moving[k % len(moving)], 2000) for k in range(200)]
    return [
        *_rows("500 trials", study, many, 300.0),
        *_rows("200 trials of 2000", study, medium, 180.0),
        *_rows("one trial of 1e6", study, [_as_long(moving[0], 1_000_000)], 180.0),
    ]


def _as_long(trial: Trial, samples: int) -> Trial:
    """The trial's stimulus again and again."""
    turns = -(-samples // len(trial))
    columns = {n: np.tile(v, turns)[:samples] for n, v in trial.columns.items()}
    return replace(trial, columns=columns, time=trial.dt * np.arange(samples))


def _rows(name: str, study: Study, trials: Sequence[Trial], wall_s: float) -> list[Row]:
    """What a diagnosis of trials with dry friction takes, of a process of its own."""
    model, rng = nominal_model(study) + CoulombFriction(torque_nm=FRICTION_NM), np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        measured = [_measured(model, t, rng, f"t{k:03d}") for k, t in enumerate(trials)]
        write_study(replace(study, name="large", trials=tuple(measured)), place / "in")
        program = str(Path(sys.executable).parent / "fes-pin")
        began = time.perf_counter()
        child = subprocess.Popen(
            [program, "diagnose", str(place / "in"), "--out", str(place / "out")], stdout=subprocess.DEVNULL
        )
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        wall = time.perf_counter() - began
        if child.returncode:
            raise SystemExit(f"{name}: exit code {child.returncode}")
        size = (place / "out/report.html").stat().st_size / 1e6
    return [
        (f"{name}: wall", wall, wall_s, "s"),
        (f"{name}: processor", used.ru_utime + used.ru_stime, None, "s"),
        (f"{name}: greatest memory", used.ru_maxrss / 2**20, MUCH_GIB, "GiB"),
        (f"{name}: report", size, None, "MB"),
    ]


def _measured(model: Model, trial: Trial, rng: np.random.Generator, name: str) -> Trial:
    """A simulated trial as it is read, with white noise."""
    made = simulate(model, trial)
    noise = {n: (1e-3 if n == "angle_rad" else 0.05) for n in model.rig.outputs(trial.kind)}
    read = {n: made[n] + std * rng.standard_normal(len(trial)) for n, std in noise.items()}
    return replace(trial.with_columns(**read), name=name)
