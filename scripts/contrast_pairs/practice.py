"""Pairs out of studies that were written by others: one half of the trials as they are, the other with a change made to
the recording that is exact: to the sensor, the clock of the stimulus, the stimulator, or the drive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial

EXACT = {"ankle": ("sensor_offset", "threshold_shift", "electromechanical_delay"), "joint": ("effort_gain",)}
"""Changes that a recording can be given afterwards, by rig."""


def practice_pair(study: Study, changes: tuple[str, ...]) -> Study:
    """The trials of a study in two groups, the second with a change; loads and kinds are in both."""
    counted: dict[tuple[str, float | None], int] = {}
    trials = []
    for trial in study.trials:
        key = (trial.kind, trial.conditions.get("load_kg"))
        counted[key] = counted.get(key, 0) + 1
        late = counted[key] % 2 == 0
        changed = trial
        for change in changes if late else ():
            changed = _with(changed, change)
        trials.append(replace(changed, group="after" if late else "before"))
    return replace(study, trials=tuple(trials))


def _with(trial: Trial, change: str) -> Trial:
    if change == "sensor_offset":
        return trial.with_columns(angle_rad=trial["angle_rad"] + 0.02) if trial.kind == "motion" else trial
    if change == "effort_gain":
        return trial.with_columns(effort=1.2 * trial["effort"]) if "effort" in trial else trial
    width = trial["pulse_width_us"]
    if change == "threshold_shift":
        return trial.with_columns(pulse_width_us=np.where(width > 0.0, width + 25.0, 0.0))
    late = round(0.02 / trial.dt)  # it answers 20 ms later; before it rests, where a stimulus may already act
    read = {n: v for n, v in trial.columns.items() if n in ("angle_rad", "force_n")}
    return trial.with_columns(**{n: np.concatenate([np.repeat(v[:1], late), v[:-late]]) for n, v in read.items()})
