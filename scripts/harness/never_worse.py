"""Errors of the model of an answer, of the believed model and of a regression, on fitted and on withheld trials.

All three predict in one simulator and in one model of the low-passed effort:

- `free`: the motion of a whole trial from its effort;
- `0.3 s`, `1 s`: the motion that far ahead, from the position and speed that a cubic reads off the recorded motion;
- `effort`: the low-passed effort of the recorded motion.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.signal import savgol_filter

import fes_pin as fp
from fes_pin.data.trial import derived_trial
from fes_pin.models.simulate import Simulator
from harness.regression import plain

HORIZONS_S = (0.3, 1.0)
EVERY_S = 0.075
"""From the start of a prediction to the next; its last quarter of the shortest horizon counts."""
WITHHELD = 0.3
"""Share of a single trial, its end, that is withheld."""
WINDOW_S = 0.1
"""Of the cubic that reads a start."""
SEEN_AS = {"creep_speed": None, "presliding": "stretch"}
"""Shapes of dry friction in a regression of efforts that a simulation does not have, or has by another name."""


def withheld(study: fp.Study) -> tuple[fp.Study, tuple[fp.Trial, ...]]:
    """The study without its held-out trials, or its last one, or the end of a single one; and what is withheld."""
    if held := tuple(t for t in study.trials if t.role == "held_out"):
        return study, held
    if len(study.trials) > 1:
        return replace(study, trials=study.trials[:-1]), study.trials[-1:]
    (trial,) = study.trials
    end = round((1.0 - WITHHELD) * len(trial))
    return replace(study, trials=(_part(trial, slice(0, end)),)), (_part(trial, slice(end, None)),)


def _part(trial: fp.Trial, rows: slice, **more: np.ndarray) -> fp.Trial:
    columns = {n: values[rows] for n, values in trial.columns.items()} | more
    return derived_trial(trial, columns=columns, time=trial.time[rows], conditions={})


def values_of(study: fp.Study, found: Any) -> dict[str, float]:
    """Every value of an answer by name: of the rig, and `cause.parameter`; those of a regression are amplitudes."""
    from fes_pin.models.effects import effect_named  # noqa: PLC0415

    record, rig = json.loads(found.to_json()), fp.nominal_model(study).parameters()
    known = {n: one["value"] for n, one in record["extended"]["parameters"].items()}
    out = {n: value for n, value in known.items() if n in rig}
    for cause in record["causes"]:
        name = cause["name"]
        own = {n: one["value"] for n, one in cause.get("parameters", {}).items()}
        own = own or {effect_named(name).amplitudes()[0]: known[name]}
        if name == "parallel_stiffness":
            own.setdefault("rest_angle_rad", 0.0)
        if name == "joint_stop":
            ends = [(t["position"].min(), t["position"].max()) for t in study.trials]
            own["side"] = 1.0 if own["angle_rad"] > np.mean(ends) else -1.0
        out |= {f"{name}.{n}": value for n, value in own.items()}
    return out


def model_of(study: fp.Study, found: Any) -> fp.Model:
    """The model of an answer: its own, or the nominal model with the causes and values of its record."""
    if hasattr(found, "model"):
        return found.model
    from fes_pin.models.effects import effect_named  # noqa: PLC0415

    values, model = values_of(study, found), fp.nominal_model(study)
    for cause in dict.fromkeys(n.partition(".")[0] for n in values if "." in n):
        kind = effect_named(cause)
        own = {n.partition(".")[2]: v for n, v in values.items() if n.startswith(f"{cause}.")}
        if cause == "coulomb_friction" and all(t.kind != "imposed" for t in study.trials):
            own = {SEEN_AS.get(n, n): v for n, v in own.items()}
        info = kind.parameters()
        model += kind(**{n: info[n].nearest(v) for n, v in own.items() if n in info})
    info = model.parameter_info()
    return model.with_parameters({n: info[n].nearest(v) for n, v in values.items() if "." not in n})


def _of_model(model: fp.Model) -> dict[str, float]:
    """Values of a model as a regression of efforts takes them; its friction changes its sign as that does."""
    values = model.parameters()
    way = max(values.pop("coulomb_friction.stretch", 0.0), values.pop("coulomb_friction.presliding", 0.0))
    values.pop("coulomb_friction.creep_speed", None)
    return {**values, "coulomb_friction.presliding": way} if "coulomb_friction.torque_nm" in values else values


def errors_against(study: fp.Study, found: Any, unseen: Sequence[fp.Trial]) -> dict[str, tuple[float, float, float]]:
    """Errors E of the model of an answer, of the believed model and of the regression, percent, by measure.

    A measure is left out where one of the causes has no such column; an error is infinite where a simulation is not
    finite. Nothing is measured of studies that are no joints with a recorded effort.
    """
    shown = [t for t in study.trials if t.role != "held_out"]
    if study.rig != "joint" or any("effort" not in t.columns for t in (*shown, *unseen)):
        return {}
    regressed = plain(study)
    models = [model_of(study, found), fp.nominal_model(study), model_of(study, regressed)]
    own = _of_model(models[0]) if hasattr(found, "model") else values_of(study, found)
    values = [own, models[1].parameters(), values_of(study, regressed)]
    out = {}
    for word, trials in (("fitted", shown), ("unseen", list(unseen))):
        each = [_moved(model, trials) for model in models]
        both = [one | more for one, more in zip(each, _efforts(study, shown, trials, values), strict=True)]
        names = [n for n in both[0] if all(n in one for one in both)]
        out |= {f"{n}, {word}": (both[0][n], both[1][n], both[2][n]) for n in names}
    return out


def _moved(model: fp.Model, trials: Sequence[fp.Trial]) -> dict[str, float]:
    """Errors of the simulated motion by measure; none where the motion is imposed."""
    moving = [t for t in trials if t.kind != "imposed"]
    ways = {"free": [(t, slice(0, len(t)), 1) for t in moving]}
    for horizon in HORIZONS_S:
        each = [(t, round(horizon / t.dt), max(1, round(EVERY_S / t.dt))) for t in moving]
        starts = [(t, start, n, every) for t, n, every in each for start in range(0, len(t) - n, every)]
        ways[f"{horizon:g} s"] = [(t, slice(k, k + n + 1), n + 1 - min(n, every)) for t, k, n, every in starts]
    return {name: _ahead(model, many) for name, many in ways.items() if many}


def _ahead(model: fp.Model, many: Sequence[tuple[fp.Trial, slice, int]]) -> float:
    """Error of parts of trials that are predicted from their starts, from a sample of each on."""
    smooth = {id(t): (_smooth(t, 0), _smooth(t, 1)) for t, _, _ in many}
    parts = []
    for trial, rows, _ in many:
        begun, speed = (one[rows].copy() for one in smooth[id(trial)])
        begun[1:] = trial["position"][rows][1:]
        parts.append(_part(trial, rows, position=begun, velocity=speed))
    squares = spread = 0.0
    with np.errstate(all="ignore"):
        for (trial, _, first), part, one in zip(
            many, parts, Simulator(model, parts).run(model.parameters()), strict=True
        ):
            read = part["position"][first:]
            squares += float(np.sum((read - one.readings[first:, 0]) ** 2))
            spread += float(np.sum((read - trial["position"].mean()) ** 2))
    return _percent(squares, spread)


def _smooth(trial: fp.Trial, order: int) -> np.ndarray:
    length = min(max(2 * round(0.5 * WINDOW_S / trial.dt) + 1, 5), (len(trial) - 1) // 2 * 2 + 1)
    return np.asarray(savgol_filter(trial["position"], length, 3, order, trial.dt))


def _percent(squares: float, spread: float) -> float:
    share = 100.0 * squares / spread if spread > 0.0 else math.inf
    return share if math.isfinite(share) else math.inf


def _efforts(
    study: fp.Study, shown: Sequence[fp.Trial], trials: Sequence[fp.Trial], models: Sequence[Mapping[str, float]]
) -> list[dict[str, float]]:
    """Errors of the low-passed effort of trials, in the band of the shown ones, by measure."""
    from fes_pin.effort.columns import Links  # noqa: PLC0415
    from fes_pin.effort.motion import Record, band_of, has_rows  # noqa: PLC0415
    from fes_pin.effort.problem import HELD_ROWS, HOLD, EffortProblem, Rows  # noqa: PLC0415
    from fes_pin.models.rigs.rigid import load_urdf  # noqa: PLC0415

    many = [[Record(t.name, t.time, t["position"], t["effort"], t.kind) for t in some] for some in (shown, trials)]
    try:
        band = band_of(many[0])
    except fp.InputError:
        return [{} for _ in models]
    if not has_rows(many[1], band):
        return [{} for _ in models]
    rows, out = Rows(many[1], band, Links.of(load_urdf(study.urdf))), list[dict[str, float]]()
    hold = HELD_ROWS * any(t.kind != "imposed" for t in trials)
    for values in models:
        causes = list(dict.fromkeys(n.partition(".")[0] for n in values if "." in n))
        if not {*causes} <= {*rows.library}:
            out.append({})
            continue
        shapes = {f"{c}.{n}": v for c in causes for n, v in rows.library[c].shapes[0].items()}
        left, _ = EffortProblem(rows, causes, {}, robust=False).residuals({**shapes, **values, HOLD: hold})
        efforts = rows.efforts({HOLD: hold})
        squares, spread = (sum(float(np.sum(one**2)) for one in each) for each in (left, efforts))
        out.append({"effort": _percent(squares, spread)})
    return out
