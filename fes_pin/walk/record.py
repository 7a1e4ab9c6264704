"""A diagnosis of walking as `diagnosis.json` and files."""

from __future__ import annotations

import tomli_w

from fes_pin.data.table import format_csv
from fes_pin.walk.result import NEXT_FILE, WalkDiagnosis

BODY_FILE = "body.urdf"

walk_record = WalkDiagnosis.record


def walk_files(diagnosis: WalkDiagnosis) -> dict[str, str | bytes]:
    """Every file of a diagnosis but the report, by name."""
    causes = [
        {"name": c.name, "site": c.site, "parameters": {n: one.value for n, one in c.parameters.items()}}
        for c in diagnosis.causes
    ]
    model = {"model": {"rig": "body", "urdf": BODY_FILE, "cutoff_hz": diagnosis.cutoff_hz}, "effect": causes}
    files: dict[str, str | bytes] = {
        "diagnosis.json": diagnosis.to_json(),
        "model.toml": tomli_w.dumps(model),
        BODY_FILE: diagnosis.model.urdf,
    }
    plan = diagnosis.next_experiment
    if plan and plan.coordinates is not None:
        files[NEXT_FILE] = format_csv(plan.coordinates)
    return files


__all__ = ["BODY_FILE", "NEXT_FILE", "walk_files", "walk_record"]
