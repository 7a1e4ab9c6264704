"""Errors of the model of an answer, of the believed model and of a regression, on fitted and on withheld trials.

All three predict in one simulator and in one model of the low-passed effort:

- `free`: the motion of a whole trial from its effort, from the position and speed that a cubic reads off its start;
- `0.3 s`, `1 s`: the motion that far ahead of the readings, whose filter assumes the same noise for every model;
- `effort`: the low-passed effort of the recorded motion: of a model by its own equations, of values by a regression.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from scipy.signal import savgol_filter

import fes_pin as fp
from fes_pin.data.trial import derived_trial
from fes_pin.models.simulate import Simulator, max_step, substeps
from harness.regression import Regressed, plain

HORIZONS_S = (0.3, 1.0)
RANDOM, RANDOM_S = 0.02, 0.05
"""Random effort that a filter assumes, as a share of the effort's root mean square, and its time constant, s."""
MOST = 1e100
"""A larger error of a position is that of a simulation that diverges."""
WITHHELD = 0.3
"""Share of a single trial, its end, that is withheld."""
WINDOW_S = 0.1
"""Of the cubic that reads a start."""
CHOICES = {
    "joint_stop.side": (1.0, -1.0),
    "sensor_gain.place": (1.0, 0.0, 2.0),
    "sensor_nonlinearity.place": (1.0, 0.0, 2.0),
}
"""What an answer by efforts chooses and does not state."""


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
    part = trial.part(rows)
    return derived_trial(part, columns={**part.columns, **more}, conditions={})


def values_of(study: fp.Study, found: Any) -> dict[str, float]:
    """Every value of an answer by name: of the rig, as believed where none is given, and `cause.parameter`.

    Those of a regression are amplitudes.
    """
    from fes_pin.models.effects import effect_named  # noqa: PLC0415

    record, rig = json.loads(found.to_json()), fp.nominal_model(study).parameters()
    known = {n: one["value"] for n, one in record["extended"]["parameters"].items()}
    out = {n: known.get(n, value) for n, value in rig.items()}
    for cause in record["causes"]:
        name = cause["name"]
        own = {n: one["value"] for n, one in cause.get("parameters", {}).items()}
        own = own or {effect_named(name).amplitudes()[0]: known[name]}
        if name == "parallel_stiffness":
            own.setdefault("rest_angle_rad", 0.0)
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
            own = _simulated_friction(study, model, own)
        info = kind.parameters()
        model += kind(**{n: info[n].nearest(v) for n, v in own.items() if n in info})
    info = model.parameter_info()
    return model.with_parameters({n: info[n].nearest(v) for n, v in values.items() if "." not in n})


def _simulated_friction(study: fp.Study, model: fp.Model, values: Mapping[str, float]) -> dict[str, float]:
    """Values of dry friction of a regression of efforts as a simulation has them.

    What builds up over a way is a contact that stretches. With stiction, or with a creep speed of its own, friction
    changes its sign as tanh(v / creep speed): its corners are as wide as `effects.CoulombFriction` says.
    """
    from fes_pin.effort.columns import SLOWLY  # noqa: PLC0415
    from fes_pin.models.effects.coulomb_friction import STIFFEST, CoulombFriction  # noqa: PLC0415

    own = {{"presliding": "stretch"}.get(n, n): v for n, v in values.items() if n != "creep_speed"}
    if not {"stiction", "creep_speed"} & {*values}:
        return own
    usual = math.sqrt(float(np.mean(np.concatenate([_smooth(t, 1) for t in study.trials]) ** 2)))
    step = max(t.dt / substeps(model, t.dt, max_step(model)) for t in study.trials)
    stopping = STIFFEST * model.parameters()["inertia_scale"] * model.rig.constants["inertia"] / step
    most = own["torque_nm"] * (1.0 + own.get("stiction", 0.0)) + stopping * CoulombFriction().creep_speed
    return {**own, "softness": values.get("creep_speed", SLOWLY * usual) * stopping / most}


def _likeliest(
    study: fp.Study, shown: Sequence[fp.Trial], model: fp.Model, values: Mapping[str, float]
) -> tuple[fp.Model, Mapping[str, float]]:
    """The model and its values with the choices that an answer does not state, as they leave the least effort."""
    unstated = [n for n in CHOICES if n.partition(".")[0] in {e.name for e in model.effects} and n not in values]
    if not unstated:
        return model, values
    every = [dict(zip(unstated, one, strict=True)) for one in product(*(CHOICES[n] for n in unstated))]
    found = _efforts(study, shown, shown, [{**values, **one} for one in every])
    _, best = min(zip(found, every, strict=True), key=lambda one: one[0].get("effort", math.inf))
    return model.with_parameters(best), {**values, **best}


def errors_against(study: fp.Study, found: Any, unseen: Sequence[fp.Trial]) -> dict[str, tuple[float, float, float]]:
    """Errors E of the model of an answer, of the believed model and of the regression, percent, by measure.

    A measure is left out where one of the causes has no such column, and free motion where the answer prints no error
    of it since the rig falls; an error is infinite where a simulation is not finite. Nothing is measured of studies
    that are no joints with a recorded effort.
    """
    shown = [t for t in study.trials if t.role != "held_out"]
    if study.rig != "joint" or any("effort" not in t.columns for t in (*shown, *unseen)):
        return {}
    regressed = plain(study)
    models = [model_of(study, found), fp.nominal_model(study), model_of(study, regressed)]
    is_model = hasattr(found, "model")
    own = models[0].parameters() if is_model else values_of(study, found)
    values = [own, models[1].parameters(), values_of(study, regressed)]
    if not is_model:
        models[0], values[0] = _likeliest(study, shown, models[0], own)
    out, falls = {}, getattr(found, "extended_error", (0.0,))[0] is None
    for word, trials in (("fitted", shown), ("unseen", list(unseen))):
        each = [_moved(model, trials) for model in models]
        efforts = _efforts(study, shown, trials, values)
        efforts[0] |= _along(study, shown, trials, models[0]) if is_model else {}
        both = [one | more for one, more in zip(each, efforts, strict=True)]
        names = [n for n in both[0] if all(n in one for one in both) and not (falls and n == "free")]
        out |= {f"{n}, {word}": (both[0][n], both[1][n], both[2][n]) for n in names}
    return out


def errors_of_truth(
    study: fp.Study, hidden: Sequence[str], truth: Mapping[str, float], unseen: Sequence[fp.Trial]
) -> dict[str, float]:
    """Errors E of the true model, percent, by measure; none where its values do not state a model of the library."""
    from fes_pin.models.effects import effect_named  # noqa: PLC0415

    if not all(name in truth and _has_one_value(effect_named(name)) for name in hidden):
        return {}
    true = Regressed(tuple(hidden), {}, {n: {"value": value} for n, value in truth.items()})
    return {n: errors[0] for n, errors in errors_against(study, true, unseen).items()}


def _has_one_value(cause: Any) -> bool:
    return len(cause.amplitudes()) + len(cause.shapes()) == 1


def _moved(model: fp.Model, trials: Sequence[fp.Trial]) -> dict[str, float]:
    """Errors of the predicted motion by measure; none where the motion is imposed."""
    from fes_pin.identify.ahead import over_horizon, reach_of  # noqa: PLC0415

    moving, out = [_begun(t) for t in trials if t.kind != "imposed"], dict[str, float]()
    if not moving:
        return out
    free = [one.readings[:, 0] for one in Simulator(model, moving).run(model.parameters())]
    out["free"] = _error(moving, free, [0] * len(moving))
    for horizon in HORIZONS_S:
        seen = [replace(t, columns={n: t[n] for n in ("position", "effort")}) for t in moving]
        if all(len(t) > sum(reach_of(t, horizon)) for t in seen):
            ahead = [over_horizon(model, t, _noise(t), horizon)["position"] for t in seen]
            out[f"{horizon:g} s"] = _error(moving, ahead, [sum(reach_of(t, horizon)) for t in seen])
    return out


def _error(trials: Sequence[fp.Trial], predicted: Sequence[np.ndarray], first: Sequence[int]) -> float:
    """E of predicted positions of trials, from a sample of each on, percent; infinite where they are not finite."""
    squares = spread = 0.0
    for trial, one, k in zip(trials, predicted, first, strict=True):
        read = trial["position"]
        squares += float(np.sum(np.minimum(np.abs(read - one)[k:], MOST) ** 2))
        spread += float(np.sum((read - read.mean())[k:] ** 2))
    return _percent(squares, spread)


def _noise(trial: fp.Trial) -> Any:
    """The noise of a filter that starts predictions of every model: of the reading, and a small random effort."""
    from fes_pin.models.predictor import StateSpaceNoise  # noqa: PLC0415

    white = math.sqrt(float(np.mean(np.diff(trial["position"], 2) ** 2)) / 6.0)
    effort = RANDOM * math.sqrt(float(np.mean(trial["effort"] ** 2)))
    return StateSpaceNoise({"position": max(white, 1e-9)}, {"effort": max(effort, 1e-9)}, {"effort": RANDOM_S})


def _begun(trial: fp.Trial) -> fp.Trial:
    """The trial with the position and the speed of its start that a cubic reads off the recorded motion."""
    position = np.append(_smooth(trial, 0)[:1], trial["position"][1:])
    return _part(trial, slice(None), position=position, velocity=_smooth(trial, 1))


def _smooth(trial: fp.Trial, order: int) -> np.ndarray:
    length = min(max(2 * round(0.5 * WINDOW_S / trial.dt) + 1, 5), (len(trial) - 1) // 2 * 2 + 1)
    return np.asarray(savgol_filter(trial["position"], length, 3, order, trial.dt))


def _percent(squares: float, spread: float) -> float:
    share = 100.0 * squares / spread if spread > 0.0 else math.inf
    return share if math.isfinite(share) else math.inf


def _along(study: fp.Study, shown: Sequence[fp.Trial], trials: Sequence[fp.Trial], model: fp.Model) -> dict[str, float]:
    """Error of the low-passed effort by a model's own equations; none where a cause of it has no part in that."""
    from fes_pin.diagnosis.along_motion import effort_band, effort_percent  # noqa: PLC0415

    band = effort_band(model.rig, shown)
    found = effort_percent(model, trials, band) if band is not None else None
    return {} if found is None else {"effort": found}


def _efforts(
    study: fp.Study, shown: Sequence[fp.Trial], trials: Sequence[fp.Trial], models: Sequence[Mapping[str, float]]
) -> list[dict[str, float]]:
    """Errors of the low-passed effort of trials, in the band of the shown ones, by measure."""
    from fes_pin.effort.columns import Links  # noqa: PLC0415
    from fes_pin.effort.motion import Record, band_of, has_rows  # noqa: PLC0415
    from fes_pin.effort.problem import HELD_ROWS, HOLD, EffortProblem, Rows  # noqa: PLC0415
    from fes_pin.models.rigs.joint import Joint  # noqa: PLC0415

    many = [[Record.of(t) for t in some] for some in (shown, trials)]
    try:
        band = band_of(many[0])
    except fp.InputError:
        return [{} for _ in models]
    if not has_rows(many[1], band):
        return [{} for _ in models]
    rows, out = Rows(many[1], band, Links.of_rig(Joint.of_study(study))), list[dict[str, float]]()
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
