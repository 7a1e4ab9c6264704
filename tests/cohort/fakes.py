"""What stands for a diagnosis in tests of a cohort: quick, and able to die; importable in another process."""

import json
import os
import signal
import time
from pathlib import Path

from fes_pin.cohort.one import Answer


def record(name: str, value: float = 1.0) -> dict:
    """A `diagnosis.json` with one cause for names that begin with f."""
    causes = [
        {
            "name": "coulomb_friction",
            "stage": "joint",
            "parameters": {"torque_nm": {"value": value, "std": 0.1}},
            "equivalents": [],
            "p_value": 1e-6,
            "gain_percent": {"fit": 80.0, "held_out": 79.0, "ci95": [70.0, 85.0]},
        }
    ]
    found = name.startswith("f")
    return {
        "study": name,
        "verdict": "causes_found" if found else "adequate",
        "causes": causes if found else [],
        "remainder": {"unexplained": False, "p_value": 0.4, "where": None},
        "nominal": {"parameters": {}, "error_percent": {"fit": 9.0, "held_out": 10.0}},
        "extended": {
            "parameters": {"gain": {"value": value, "std": 0.2}},
            "error_percent": {"fit": 2.0, "held_out": 3.0},
        },
        "ceiling_percent": 1.5,
        "wall_s": 0.1,
    }


def quick(work, key):
    """Count the call in a file beside the study; fail, die or take a while as the study's name says."""
    with (Path(work.folder) / "calls").open("a") as calls:
        calls.write(f"{os.getpid()}\n")
    if "killer" in work.name:
        os.kill(os.getpid(), signal.SIGKILL)
    if "bad" in work.name:
        return Answer(work.name, key, {}, "study.toml, rig: expected a rig")
    time.sleep(0.15)
    made = record(work.name, 1.0 + len(work.name))
    return Answer(work.name, key, {"diagnosis.json": json.dumps(made), "report.html": "<p>report</p>"})


def studies(folder: Path, names: list[str]) -> Path:
    """Folders that look like studies."""
    for name in names:
        (folder / name).mkdir(parents=True)
        (folder / name / "study.toml").write_text(f'[study]\nname = "{name}"\n')
    return folder


def calls(folder: Path) -> dict[str, int]:
    """How often each study was begun."""
    return {p.parent.name: len(p.read_text().splitlines()) for p in sorted(folder.glob("*/calls"))}
