"""A cohort on this machine: studies an hour with one process and with two, and the greatest memory of a process.

.venv/bin/python scripts/benchmarks/show.py cohort
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

STUDY = Path(__file__).parents[2] / "analysis" / "studies" / "ankle_demo"
COPIES = 8


def run() -> list[tuple[str, float, float | None, str]]:
    """Rows of (name, measured, target, unit)."""
    rows: list[tuple[str, float, float | None, str]] = []
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        for k in range(COPIES):
            shutil.copytree(STUDY, place / "in" / f"subject{k}")
        _cohort(place, 1, "compiled")  # what is compiled is kept
        spent = {workers: _cohort(place, workers, f"out{workers}") for workers in (1, 2)}
        for workers, (wall, processor) in spent.items():
            rows.append((f"{workers} process{'es' * (workers > 1)}: a study, wall", wall / COPIES, None, "s"))
            rows.append((f"{workers} process{'es' * (workers > 1)}: a study, processor", processor / COPIES, None, "s"))
        rows.append(("gain of the second process", spent[1][0] / spent[2][0], None, "times"))
        again, _ = _cohort(place, 2, "out2")
        rows.append(("the same again: nothing to do", again, None, "s"))
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 2**20
    return [*rows, ("greatest memory of a process", peak, 1.0, "GiB")]


def _cohort(place: Path, workers: int, out: str) -> tuple[float, float]:
    """Wall and processor time of a cohort, s."""
    command = [str(Path(sys.executable).parent / "fes-pin"), "cohort", str(place / "in"), "--out", str(place / out)]
    began, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [*command, "--workers", str(workers)],
        env={**os.environ, "FES_PIN_CACHE": str(place / "cache")},
        capture_output=True,
        check=True,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.perf_counter() - began, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
