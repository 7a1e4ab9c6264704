"""Whether the effort of a joint is a torque, or the goal position of a controller in the column of the effort.

A position controller of stiffness k and damping d applies the torque k (goal - q) - d v, so that

    goal = q + (inertia a + gravity(q)) / k + (damping + d) v / k + friction / k

A torque has the weight 1 at the inertia and the gravity of the URDF, and a goal 1 at the position and 1 / k at them.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from fes_pin.data.direction import FARTHEST, FEWEST, band_hz, moved, smoothed_rows
from fes_pin.data.errors import InputError
from fes_pin.data.plausibility import ToPredict, trials_named
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.models.rigs.base import Rig
from fes_pin.models.rigs.joint import Joint

CLOSE = 0.05
"""Distance of the weight of the position from 1 within which an effort is a goal: gears and scales are within it."""
LESS = 0.5
"""Weight of the believed inertia and gravity below which an effort is no torque: beliefs are rarely wrong by a half."""
EXPLAINED = 0.95
"""Least share of the variance of a goal that the equation explains."""
SURELY = 3.0
"""Standard deviations by which the weight of inertia and gravity may be larger than its estimate."""


def check_no_goal(study: Study | ToPredict, rig: Rig) -> None:
    """Raise InputError where the efforts of a joint are goal positions."""
    driven = _driven(study.trials)
    if (stiffness := _stiffness(driven, rig)) is not None:
        raise InputError(_words(driven, stiffness, rig, "expected"), file=study.folder, column="effort")


def with_efforts_of_goals(trials: Sequence[Trial], rig: Rig) -> tuple[tuple[Trial, ...], list[str]]:
    """Return trials with the effort of a controller in the place of its goal positions, and a warning about them.

    The stiffness of the controller has the scale of the URDF's inertia and gravity. Trials that are held out have no
    part in it. The damping that is fitted to such efforts includes that of the controller.
    """
    driven = _driven(trials)
    if (stiffness := _stiffness(fitted_of(driven), rig)) is None:
        return tuple(trials), []
    one_of = {id(t): t.with_columns(effort=stiffness * (t["effort"] - t["position"])) for t in driven}
    return tuple(one_of.get(id(t), t) for t in trials), [f"effort {_words(driven, stiffness, rig, 'taken')}"]


def fitted_of(trials: Sequence[Trial]) -> list[Trial]:
    """Return the trials that are not held out; all, where each one is."""
    return [t for t in trials if t.role != "held_out"] or [*trials]


def _driven(trials: Sequence[Trial]) -> list[Trial]:
    return [t for t in trials if {"effort", "position"} <= {*t.columns} and len(t) >= FEWEST]


def _stiffness(driven: Sequence[Trial], rig: Rig) -> float | None:
    return stiffness_of_goal(driven, rig.constants) if isinstance(rig, Joint) and driven else None


def _words(driven: Sequence[Trial], stiffness: float, rig: Rig, verb: str) -> str:
    names, units = trials_named([t.name for t in driven]), rig.units()
    looks = f"looks like a goal position in {names}: the position follows it one to one"
    size = f"{stiffness:.2g} {units['effort']}/{units['q']}"
    return f"{looks}; {verb}: an effort of {size} times (goal - position), if the URDF's inertia is right"


def stiffness_of_goal(trials: Sequence[Trial], constants: Mapping[str, float]) -> float | None:
    """Return the stiffness of the controller whose goals are the efforts of trials; None where they are no goals.

    Parameters
    ----------
    trials
        Each with the columns "position" and "effort".
    constants
        Of the joint: `inertia`, `gravity_cos`, `gravity_sin`, `revolute`.
    """
    moving = [t for t in trials if 0.0 < np.ptp(t["position"]) < FARTHEST and 0.0 < np.ptp(t["effort"]) < FARTHEST]
    band = band_hz(moving)
    if not math.isfinite(band):
        return None
    usual = float(np.sqrt(np.mean(np.concatenate([moved(t, band)[1] for t in moving]) ** 2)))
    rows = []
    for trial in moving:
        q, v, a, effort = moved(trial, band)
        turned = constants["revolute"] * q
        weight = constants["gravity_cos"] * np.cos(turned) + constants["gravity_sin"] * np.sin(turned)
        known = [q, constants["inertia"] * a + weight, v, np.tanh(v / (CLOSE * usual)), np.ones_like(q)]
        rows.append(smoothed_rows(trial, np.stack([*known, effort]), band))
    every = np.concatenate(rows)
    columns, effort = every[:, :-1], every[:, -1]
    if np.linalg.matrix_rank(columns) < columns.shape[1] or len(effort) <= columns.shape[1]:
        return None
    weights = np.linalg.lstsq(columns, effort, rcond=None)[0]
    missed = effort - columns @ weights
    spread = np.linalg.norm(np.linalg.pinv(columns), axis=1) * math.sqrt(float(missed @ missed) / len(effort))
    of_torque = float(weights[1] + SURELY * spread[1])
    is_goal = abs(weights[0] - 1.0) < CLOSE and 0.0 < of_torque < LESS
    if not is_goal or float(np.var(missed)) > (1.0 - EXPLAINED) * float(np.var(effort)):
        return None
    return 1.0 / max(float(weights[1]), 1e-300)
