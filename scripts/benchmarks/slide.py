"""The diagnosis of a slide under position control, four trials of 25 s at 1 kHz: its time, and what it finds.

.venv/bin/python scripts/benchmarks/show.py slide

The slide's friction is that of bristles, made without the engine; its effort is read with an offset.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from unittest import mock

sys.path.insert(0, str(Path(__file__).parents[1]))

from driven.bristles import DAMPING, FRICTION, MASS, trial
from driven_rigs.draw import Base, urdf

import fes_pin as fp
from fes_pin.data.study import Study
from fes_pin.prepare import long_records

OFFSET = 3.0
"""What the effort is read with too much, N."""
DT, SECONDS = 1e-3, 25.0


def run() -> list[tuple[str, float, float | None, str]]:
    """Rows of (name, measured, target, unit): a first diagnosis compiles what it needs, a later one does not."""
    with tempfile.TemporaryDirectory(prefix="slide") as folder:
        study = slide(Path(folder))
        first, found = _diagnosed(study)
        later, _ = _diagnosed(study)
        with mock.patch.object(long_records, "MOST_DRIVEN", sum(map(len, study.trials))):
            _diagnosed(study)
            whole, of_every = _diagnosed(study)
    return [
        ("slide, 4 x 25 s at 1 kHz: with what must be compiled", first, None, "s"),
        ("slide, 4 x 25 s at 1 kHz: later", later, 20.0, "s"),
        *_found(found),
        ("by every sample", whole, None, "s"),
        *_found(of_every),
    ]


def _found(found: fp.Diagnosis) -> list[tuple[str, float, float | None, str]]:
    values = found.extended.values
    return [
        ("dry friction", values.get("coulomb_friction.torque_nm", 0.0), FRICTION, "N"),
        ("offset of the effort", values.get("effort_offset.offset", 0.0), -OFFSET, "N"),
    ]


def slide(folder: Path) -> Study:
    """The study: the slide is believed to be without friction, lighter and less damped."""
    trials = [trial(seed, DT, SECONDS) for seed in range(4)]
    read = tuple(t.with_columns(effort=t["effort"] + OFFSET) for t in trials)
    rig = folder / "rig.urdf"
    rig.write_text(urdf(Base("slide", MASS, DAMPING, 0.0, 0.25, 15.0)))
    start = {"inertia_scale": 0.8, "damping": 0.6 * DAMPING}
    return Study("slide", "joint", {"gravity_scale": 0.0}, start, read, folder, {"urdf": rig})


def _diagnosed(study: Study) -> tuple[float, fp.Diagnosis]:
    began = time.perf_counter()
    found = fp.diagnose(study)
    return time.perf_counter() - began, found
