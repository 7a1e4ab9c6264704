"""A comparison on disk: `compare.json`."""

from __future__ import annotations

import json
from typing import Any

from fes_pin.comparison.result import Apart, Compared, Comparison
from fes_pin.diagnosis.record import shown

FILE = "compare.json"


def comparison_record(found: Comparison) -> dict[str, Any]:
    """`compare.json` as a dictionary."""
    return {
        "study": found.study.name,
        "held_out": {"by": found.by, "trials": list(found.held_out)},
        "horizon_s": shown(found.horizon_s),
        "given_s": None if found.given_s is None else shown(found.given_s),
        "best": {kind: list(found.best(kind)) for kind in ("free", "horizon")},
        "models": [_model(m) for m in found.models],
        "warnings": list(found.warnings),
        "wall_s": round(found.wall_s, 2),
    }


def comparison_json(found: Comparison) -> str:
    """The text of `compare.json`."""
    return json.dumps(comparison_record(found), indent=1, allow_nan=False) + "\n"


def _model(one: Compared) -> dict[str, Any]:
    return {
        "name": one.name,
        "words": one.words,
        "source": one.source,
        "effects": [e.name for e in one.fit.model.effects],
        "not_felt": list(one.unfelt),
        "parameters": {n: shown(one.fit.values[n]) for n in one.fit.free},
        "rmse": {c: {k: shown(v) for k, v in errors.items()} for c, errors in one.rmse.items()},
        "error_percent": {k: shown(v) for k, v in one.percent.items()},
        "of_each_trial": {k: [shown(float(v)) for v in values] for k, values in one.squares.items()},
        "worse_than_best": {k: _apart(a) for k, a in one.apart.items()},
        "converged": one.converged,
    }


def _apart(apart: Apart | None) -> dict[str, Any] | None:
    if apart is None:
        return None
    return {"percent": shown(apart.more), "low": shown(apart.low), "high": shown(apart.high), "told": apart.told}
