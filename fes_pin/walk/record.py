"""A diagnosis of walking as `diagnosis.json` and files."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import tomli_w

from fes_pin.data.numbers import printed
from fes_pin.data.table import format_csv
from fes_pin.walk.judge import CHANNELS
from fes_pin.walk.result import WalkCause, WalkDiagnosis

DIGITS = 5
NEXT_FILE = "next_trial.csv"
BODY_FILE = "body.urdf"


def _shown(value: float | None) -> float | None:
    """A number as printed; None for what is not finite."""
    return printed(value, DIGITS)


def walk_record(diagnosis: WalkDiagnosis) -> dict[str, Any]:
    """`diagnosis.json` as a dictionary."""
    plan = diagnosis.next_experiment
    trial = None
    if plan and plan.conditions is not None:
        trial = {"coordinates": NEXT_FILE, "file": NEXT_FILE, "kind": "motion", **plan.conditions}
    parameters = {
        f"{c.name}.{n}": {"value": _shown(v), "std": _shown(s)}
        for c in diagnosis.causes
        for n, (v, s, _) in c.parameters.items()
    }
    errors = ({"fit": _shown(f), "held_out": _shown(h)} for f, h in (diagnosis.nominal_error, diagnosis.extended_error))
    return {
        "study": diagnosis.study.name,
        "verdict": diagnosis.verdict,
        "causes": [_cause(c) for c in diagnosis.causes],
        "remainder": {
            "unexplained": diagnosis.remainder.unexplained,
            "p_value": _shown(diagnosis.remainder.p_value),
            "where": diagnosis.remainder.where,
        },
        "absorbed": list(diagnosis.absorbed),
        "nominal": {"parameters": {}, "error_percent": next(errors)},
        "extended": {"parameters": parameters, "error_percent": next(errors)},
        "noise": _noise(diagnosis),
        "ceiling_percent": _shown(diagnosis.ceiling_percent),
        "next_experiment": {"why": plan.why, "separates": list(plan.separates), "trial": trial} if plan else None,
        "cutoff_hz": diagnosis.cutoff_hz,
        "warnings": list(diagnosis.warnings),
        "wall_s": round(diagnosis.wall_s, 2),
    }


def _cause(cause: WalkCause) -> dict[str, Any]:
    held = cause.gain_held_out
    return {
        "name": cause.name,
        "stage": cause.stage,
        "site": cause.site,
        "parameters": {
            n: {"value": _shown(v), "std": _shown(s), "unit": u} for n, (v, s, u) in cause.parameters.items()
        },
        "equivalents": list(cause.equivalents),
        "p_value": _shown(cause.p_value),
        "gain_percent": {
            "fit": _shown(cause.gain_fit),
            "held_out": _shown(held.percent) if held else None,
            "ci95": [_shown(held.low), _shown(held.high)] if held else None,
            "other_leg": _shown(cause.other_leg_percent),
        },
    }


def _noise(diagnosis: WalkDiagnosis) -> dict[str, Any]:
    """Root mean square of what the extended model leaves in the mean stride, by channel: N and N m."""
    banks, best = diagnosis.search.banks, diagnosis.best
    left = banks.bank(best.forms).y
    if best.forms:
        columns = np.concatenate([banks.bank(best.forms).x[i] for i in best.forms], axis=3)
        left = left - columns @ best.fitted.values
    size = np.sqrt(np.sum(left[0] ** 2, axis=1))
    return {name.replace(" ", "_"): {"std": _shown(float(s)), "ar": []} for name, s in zip(CHANNELS, size, strict=True)}


def walk_files(diagnosis: WalkDiagnosis) -> dict[str, str | bytes]:
    """Every file of a diagnosis but the report, by name."""
    causes = [
        {"name": c.name, "site": c.site, "parameters": {n: v for n, (v, _, _) in c.parameters.items()}}
        for c in diagnosis.causes
    ]
    model = {"model": {"rig": "body", "urdf": BODY_FILE, "cutoff_hz": diagnosis.cutoff_hz}, "effect": causes}
    files: dict[str, str | bytes] = {
        "diagnosis.json": json.dumps(walk_record(diagnosis), indent=1, allow_nan=False) + "\n",
        "model.toml": tomli_w.dumps(model),
        BODY_FILE: diagnosis.model.urdf,
    }
    plan = diagnosis.next_experiment
    if plan and plan.coordinates is not None:
        files[NEXT_FILE] = format_csv(plan.coordinates)
    return files
