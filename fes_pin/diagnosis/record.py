"""A diagnosis on disk: `diagnosis.json` as the contract says, and the next experiment's stimulus."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

from fes_pin.data.log import Log
from fes_pin.data.numbers import printed
from fes_pin.data.trial import trial_csv
from fes_pin.diagnosis.cause import Cause
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.identify.fit import Fit
from fes_pin.identify.stored import log_table, stored_tables
from fes_pin.models.store import model_toml

DIGITS = 6
"""Significant digits printed: the last that does not depend on how sums are ordered."""
LEAST_P = 1e-300
"""What stands for a p-value that is too small for a number: it is at most this."""
NEXT_FILE = "next_trial.csv"


def shown(value: float | None) -> float | None:
    """A number as printed; None for what is not finite."""
    return printed(value, DIGITS)


def _p_shown(value: float) -> float | None:
    """A p-value as printed: no chance is zero."""
    return shown(max(value, LEAST_P)) if math.isfinite(value) else None


def diagnosis_record(diagnosis: Diagnosis) -> dict[str, Any]:
    """`diagnosis.json` as a dictionary."""
    return {
        "study": diagnosis.study.name,
        "verdict": diagnosis.verdict,
        "causes": [_cause(c, diagnosis.was_held_out or c.trial is not None) for c in diagnosis.causes],
        "remainder": {
            "unexplained": diagnosis.remainder.unexplained,
            "p_value": _p_shown(diagnosis.remainder.p_value),
            "where": diagnosis.remainder.where,
        },
        "absorbed": list(diagnosis.absorbed),
        "nominal": {"parameters": _parameters(diagnosis.nominal), "error_percent": _errors(diagnosis, "nominal")},
        "extended": {"parameters": _parameters(diagnosis.extended), "error_percent": _errors(diagnosis, "extended")},
        "noise": {
            n: {"std": shown(m.std), "ar": [shown(a) for a in m.ar]} for n, m in diagnosis.extended.noise.items()
        },
        "ceiling_percent": shown(diagnosis.ceiling_percent),
        "next_experiment": _experiment(diagnosis),
        **_left_out(diagnosis),
        **({"reason": diagnosis.reason} if diagnosis.reason else {}),
        **({"log": log_table(diagnosis.log)} if diagnosis.log != Log() else {}),
        **_library(diagnosis),
        **_over_time(diagnosis),
        "warnings": list(diagnosis.warnings),
        "wall_s": round(diagnosis.wall_s, 2),
        **({"provenance": diagnosis.provenance.record()} if diagnosis.provenance else {}),
    }


def by_command(diagnosis: Diagnosis, command: str) -> Diagnosis:
    """The diagnosis with a command line in its provenance."""
    if diagnosis.provenance is None:
        return diagnosis
    return replace(diagnosis, provenance=replace(diagnosis.provenance, command=command))


def diagnosis_files(diagnosis: Diagnosis) -> dict[str, str]:
    """Every file of a diagnosis but the report, by name."""
    files = {
        "diagnosis.json": json.dumps(diagnosis_record(diagnosis), indent=1, allow_nan=False) + "\n",
        "model.toml": model_toml(diagnosis.model, stored_tables(diagnosis.extended, diagnosis.log)),
    }
    if diagnosis.next_experiment and diagnosis.next_experiment.trial is not None:
        files[NEXT_FILE] = trial_csv(diagnosis.next_experiment.trial)
    return files


def _cause(cause: Cause, held_out: bool) -> dict[str, Any]:
    """`held_out` says whether its gain is one on trials held out."""
    held = cause.gain_held_out
    return {
        "name": cause.name,
        "stage": cause.stage,
        **({"trial": cause.trial, "words": cause.words} if cause.trial is not None else {}),
        "parameters": {n: {"value": shown(p.value), "std": shown(p.std)} for n, p in cause.parameters.items()},
        "equivalents": list(cause.equivalents),
        "p_value": _p_shown(cause.p_value),
        **({"chosen_again": list(some)} if (some := cause.chosen_in_some) else {}),
        "gain_percent": {
            "fit": shown(cause.gain_fit),
            "held_out": shown(held.percent) if held_out else None,
            "ci95": [shown(held.low), shown(held.high)],
            **({"ahead_s": shown(held.ahead_s)} if held.ahead_s is not None else {}),
        },
    }


def _left_out(diagnosis: Diagnosis) -> dict[str, Any]:
    """Samples left out as spikes by trial and column; no key where there are none."""
    found = {t: {n: len(k) for n, k in columns.items()} for t, columns in diagnosis.left_out.items()}
    return {"left_out_samples": found} if found else {}


def _library(diagnosis: Diagnosis) -> dict[str, Any]:
    """Causes and rigs that are not written here, by the file or module that holds them; no key where there are none."""
    found = {Path(where).name: names for where, names in diagnosis.catalogue.origins().items()}
    return {"library": found} if found else {}


def _parameters(fitted: Fit) -> dict[str, Any]:
    return {n: {"value": shown(fitted.values[n]), "std": shown(fitted.std(n))} for n in fitted.free}


def _errors(diagnosis: Diagnosis, which: str) -> dict[str, float | None]:
    """E of one of the two models: free, fitted and held out; on one of them one sample and a horizon ahead as well."""
    free = getattr(diagnosis, f"{which}_error")
    out = {"fit": shown(free[0]), "held_out": shown(free[1])}
    if diagnosis.ahead is not None:
        held, fitted = getattr(diagnosis.ahead, f"{which}_held_out"), getattr(diagnosis.ahead, which)
        told = held or fitted
        out.update({n: shown(getattr(told, n)) for n in ("one_step", "horizon", "free")})
    return out


def _over_time(diagnosis: Diagnosis) -> dict[str, Any]:
    """How far ahead a horizon looks, and what acts on a driven rig at random."""
    if diagnosis.ahead is None:
        return {}
    horizon = {"horizon_s": shown(diagnosis.ahead.horizon_s)}
    if not diagnosis.is_driven:
        return horizon
    random = {
        r.name: {
            "std": shown(r.std),
            "time_constant_s": shown(r.time_constant_s),
            "share_percent": shown(100.0 * r.share),
        }
        for r in diagnosis.random
    }
    told = diagnosis.ahead.extended_held_out or diagnosis.ahead.extended
    return {**horizon, "horizon_ceiling_percent": shown(told.noise), "random": random}


def _experiment(diagnosis: Diagnosis) -> dict[str, Any] | None:
    plan = diagnosis.next_experiment
    if plan is None:
        return None
    trial = None
    if plan.trial is not None:
        trial = {"file": NEXT_FILE, "kind": plan.trial.kind, **{n: shown(v) for n, v in plan.trial.conditions.items()}}
    return {"why": plan.why, "separates": list(plan.separates), "trial": trial}
