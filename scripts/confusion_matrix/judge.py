"""A diagnosis beside the truth, as one record."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from confusion_matrix.generator import Made
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.identify.per_trial import predictions


def judge(made: Made) -> dict[str, Any]:
    """Diagnose a study and compare."""
    began, used = time.perf_counter(), time.process_time()
    diagnosis = diagnose_joint(made.study)
    wall, cpu = time.perf_counter() - began, time.process_time() - used
    named, causes = {c.name for c in diagnosis.causes}, made.item.causes
    return {
        **known(made),
        "verdict": diagnosis.verdict,
        "sets": [[c.name, *c.equivalents] for c in diagnosis.causes],
        "unexplained": bool(diagnosis.verdict == "unexplained" or diagnosis.remainder.unexplained),
        "where": diagnosis.remainder.where,
        "absorbed": sorted(set(diagnosis.absorbed) & set(causes)),
        "parameters": _parameters(made, diagnosis) if named == set(causes) and causes else [],
        "share": _share(made, diagnosis),
        "wall_s": round(wall, 2),
        "cpu_s": round(cpu, 2),
    }


def known(made: Made) -> dict[str, Any]:
    """What is known of a study before anybody is asked."""
    item = made.item
    return {
        "id": item.name,
        "kind": item.kind,
        "rig": item.rig,
        "causes": list(item.causes),
        "form": item.form,
        "noise": item.noise,
        "target": item.distance,
        "d": [round(d, 2) for d in made.distances],
        "felt": None if made.felt is None else round(made.felt, 2),
        "size": [float(f"{s:.5g}") for s in made.sizes],
        "orthogonal": None if made.orthogonal is None else round(made.orthogonal, 2),
    }


def _parameters(made: Made, diagnosis: Diagnosis) -> list[list[Any]]:
    """Name, truth, estimate and standard deviation of what was fitted, where the form is the engine's."""
    fitted, out = diagnosis.extended, []
    for name in fitted.free:
        std = fitted.std(name)
        if name in made.truth and math.isfinite(std) and std > 0:
            out.append([name, *(float(f"{x:.6g}") for x in (made.truth[name], fitted.values[name], std))])
    return out


def _share(made: Made, diagnosis: Diagnosis) -> float | None:
    """Share of the nominal model's squared error on fresh noiseless trials that the extended model removes."""
    if not made.item.causes:
        return None
    errors = []
    for fitted in (diagnosis.nominal, diagnosis.extended):
        total = 0.0
        for trial in made.fresh:
            (readings,) = predictions(fitted.model, [trial], fitted.noise)
            column = "force_n" if trial.kind == "isometric" else fitted.model.rig.output(trial.kind)
            total += float(np.sum((trial[column] - readings[:, 0]) ** 2))
        errors.append(total)
    return round(1.0 - errors[1] / errors[0], 4) if errors[0] > 0 and math.isfinite(errors[1]) else None
