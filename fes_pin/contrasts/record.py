"""A contrast on disk: `contrast.json` as the study format says."""

from __future__ import annotations

import json
from typing import Any

from fes_pin.contrasts.result import Change, Contrast
from fes_pin.diagnosis.record import shown

FILE = "contrast.json"


def contrast_record(found: Contrast) -> dict[str, Any]:
    """`contrast.json` as a dictionary."""
    left = found.remainder
    return {
        "study": found.study.name,
        "groups": list(found.groups),
        "verdict": found.verdict,
        "changes": [_change(c) for c in found.changes],
        "common": list(found.common),
        "unchanged": {n: {"at_most": shown(v)} for n, v in found.unchanged.items()},
        "excluded": {n: {"at_most": shown(p.value), "unit": p.unit} for n, p in found.excluded.items()},
        "untestable": list(found.untestable),
        "repeats": {n: shown(v) for n, v in found.repeats.items()},
        "remainder": {"unexplained": left.unexplained, "p_value": shown(left.p_value), "where": left.where},
        "judged_by": "predictions" if found.driven else "simulations",
        "warnings": list(found.warnings),
        "wall_s": round(found.wall_s, 2),
    }


def contrast_json(found: Contrast) -> str:
    """The text of `contrast.json`."""
    return json.dumps(contrast_record(found), indent=1, allow_nan=False) + "\n"


def _change(change: Change) -> dict[str, Any]:
    return {
        "name": change.name,
        "kind": change.kind,
        "group": change.group,
        **({"trial": change.trial} if change.trial is not None else {}),
        "words": change.words,
        "parameters": {
            n: {g: {"value": shown(p.value), "std": shown(p.std)} for g, p in by_group.items()}
            for n, by_group in change.parameters.items()
        },
        "equivalents": list(change.equivalents),
        "p_value": shown(change.p_value),
    }
