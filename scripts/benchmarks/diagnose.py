"""A whole diagnosis: time and memory, first with nothing compiled, then as on every later day.

.venv/bin/python scripts/benchmarks/show.py diagnose
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

STUDY = Path(__file__).parents[2] / "analysis" / "studies" / "ankle_demo"


def run() -> list[tuple[str, float, float | None, str]]:
    """Rows of (name, measured, target, unit), for each study: the demo's and, where they are, two practice studies."""
    shared = Path(os.environ.get("FES_PIN_DATA", Path(__file__).parents[3] / "shared")) / "practice"
    studies = [STUDY, *(shared / n for n in ("p13_one", "q01_two") if (shared / n).is_dir())]
    rows: list[tuple[str, float, float | None, str]] = []
    for study in studies:
        with tempfile.TemporaryDirectory() as cache:
            cold, warm = (_diagnose(study, cache) for _ in range(2))
        rows.append((f"{study.name}: first time, nothing compiled", cold, None, "s"))
        rows.append((f"{study.name}: later", warm, 10.0, "s"))
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 2**20
    return [*rows, ("greatest memory", peak, 1.0, "GiB")]


def _diagnose(study: Path, cache: str) -> float:
    command = str(Path(sys.executable).parent / "fes-pin")
    with tempfile.TemporaryDirectory() as out:
        began = time.perf_counter()
        subprocess.run(
            [command, "diagnose", str(study), "--out", out],
            env={**os.environ, "FES_PIN_CACHE": cache},
            capture_output=True,
            check=True,
        )
        return time.perf_counter() - began
