"""A diagnosis of walking in words, and as `diagnosis.json` and files."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import tomli_w

from fes_pin.data.table import format_csv
from fes_pin.walk.diagnosis import WalkCause, WalkDiagnosis
from fes_pin.walk.judge import CHANNELS

DIGITS = 5
NEXT_FILE = "next_trial.csv"
BODY_FILE = "body.urdf"
HEADLINES = {
    "adequate": "the walking model is adequate: these data justify no extension of it.",
    "unexplained": "the walking model misses something, and nothing in the library explains it.",
}


def headline(diagnosis: WalkDiagnosis) -> str:
    """The verdict in one sentence."""
    count = len(diagnosis.causes)
    if not count:
        return HEADLINES[diagnosis.verdict]
    rest = ", and something is left" if diagnosis.remainder.unexplained else ""
    return (
        f"{'one cause explains' if count == 1 else f'{count} causes explain'} what the walking model gets wrong{rest}."
    )


def cause_row(cause: WalkCause) -> tuple[str, str, str, str, str]:
    """Cause, site, parameters, held-out gain, what it cannot be told from."""
    values = ", ".join(f"{n} {v:.3g} +- {s:.1g} {u}".strip() for n, (v, s, u) in cause.parameters.items())
    held = cause.gain_held_out
    shown = f"{held.percent:.0f} % [{held.low:.0f}, {held.high:.0f}]" if held else "one stride: none"
    return cause.name, cause.site, values, shown, ", ".join(cause.equivalents) or "-"


def footnotes(diagnosis: WalkDiagnosis) -> list[str]:
    """What stands beneath the table."""
    before, after = diagnosis.nominal_error, diagnosis.extended_error
    shown = [
        f"{b:.2f} -> {a:.2f} % {where}"
        for b, a, where in zip(before, after, ("fitted", "strides held out"), strict=True)
        if a is not None and b is not None
    ]
    noise = f"stride to stride {diagnosis.ceiling_percent:.2f} %; low pass {diagnosis.cutoff_hz:g} Hz"
    lines = [f"error E {', '.join(shown)}; {noise}"]
    where = f", most in {diagnosis.remainder.where}" if diagnosis.remainder.where else ""
    state = "something comes" if diagnosis.remainder.unexplained else "nothing more comes"
    lines.append(f"{state} again in every stride (p = {diagnosis.remainder.p_value:.2g}{where})")
    for cause in diagnosis.causes:
        if cause.other_leg_percent is not None:
            lines.append(
                f"{cause.name}: fitted to one leg's stances it gains {cause.other_leg_percent:.0f} % on the other's"
            )
        if cause.elsewhere:
            lines.append(f"{cause.name}: as well at {'; '.join(cause.elsewhere[:4])}")
    if diagnosis.absorbed:
        lines.append(f"not testable here: {', '.join(diagnosis.absorbed)}")
    if diagnosis.next_experiment:
        lines.append(f"next experiment: {diagnosis.next_experiment.why}")
    return [*lines, *(f"warning: {words}" for words in diagnosis.warnings)]


def verdict_text(diagnosis: WalkDiagnosis) -> str:
    """The verdict as plain text."""
    lines = [f"{diagnosis.study.name}: {headline(diagnosis)}"]
    rows = [("cause", "site", "parameters", "held-out gain", "cannot be told from")]
    rows += [cause_row(c) for c in diagnosis.causes]
    if len(rows) > 1:
        widths = [max(len(r[k]) for r in rows) for k in range(5)]
        lines += [" " + "  ".join(c.ljust(w) for c, w in zip(r, widths, strict=True)).rstrip() for r in rows]
    return "\n".join(lines + [f" {note}" for note in footnotes(diagnosis)])


def shown(value: float | None) -> float | None:
    """A number as printed; None for what is not finite."""
    return None if value is None or not math.isfinite(value) else float(f"{value:.{DIGITS}g}")


def walk_record(diagnosis: WalkDiagnosis) -> dict[str, Any]:
    """`diagnosis.json` as a dictionary."""
    plan = diagnosis.next_experiment
    trial = None
    if plan and plan.conditions is not None:
        trial = {"coordinates": NEXT_FILE, "file": NEXT_FILE, "kind": "motion", **plan.conditions}
    parameters = {
        f"{c.name}.{n}": {"value": shown(v), "std": shown(s)}
        for c in diagnosis.causes
        for n, (v, s, _) in c.parameters.items()
    }
    errors = ({"fit": shown(f), "held_out": shown(h)} for f, h in (diagnosis.nominal_error, diagnosis.extended_error))
    return {
        "study": diagnosis.study.name,
        "verdict": diagnosis.verdict,
        "causes": [_cause(c) for c in diagnosis.causes],
        "remainder": {
            "unexplained": diagnosis.remainder.unexplained,
            "p_value": shown(diagnosis.remainder.p_value),
            "where": diagnosis.remainder.where,
        },
        "absorbed": list(diagnosis.absorbed),
        "nominal": {"parameters": {}, "error_percent": next(errors)},
        "extended": {"parameters": parameters, "error_percent": next(errors)},
        "noise": _noise(diagnosis),
        "ceiling_percent": shown(diagnosis.ceiling_percent),
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
        "parameters": {n: {"value": shown(v), "std": shown(s), "unit": u} for n, (v, s, u) in cause.parameters.items()},
        "equivalents": list(cause.equivalents),
        "p_value": shown(cause.p_value),
        "gain_percent": {
            "fit": shown(cause.gain_fit),
            "held_out": shown(held.percent) if held else None,
            "ci95": [shown(held.low), shown(held.high)] if held else None,
            "other_leg": shown(cause.other_leg_percent),
        },
    }


def _noise(diagnosis: WalkDiagnosis) -> dict[str, Any]:
    """Root mean square of what the extended model leaves in the mean stride, by channel: N and N m."""
    search, best = diagnosis.search, diagnosis.best
    left = search.bank(best.forms).y
    if best.forms:
        columns = np.concatenate([search.bank(best.forms).x[i] for i in best.forms], axis=3)
        left = left - columns @ best.fitted.values
    size = np.sqrt(np.sum(left[0] ** 2, axis=1))
    return {name.replace(" ", "_"): {"std": shown(float(s)), "ar": []} for name, s in zip(CHANNELS, size, strict=True)}


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
