"""Angles of the trials of a study: they do not wrap, and trials of one rig are read in the same turn."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fes_pin.data.recorded.wraps import ANGLES, middle, unwrapped
from fes_pin.data.trial import Trial, derived_trial
from fes_pin.data.urdf import is_revolute


def with_whole_turns(trials: Sequence[Trial], files: Mapping[str, Path]) -> tuple[Trial, ...]:
    """Return trials of one rig with angles that do not wrap, and a remark about each that did.

    A trial that swings is moved by whole periods to where the other trials are, or next to zero.

    Parameters
    ----------
    files
        Of the study: a URDF says whether the joint turns.
    """
    names = [n for n in ANGLES if any(n in t for t in trials)]
    if "position" in names and not is_revolute(files.get("urdf")):
        names.remove("position")
    found = {
        (k, name): one
        for k, trial in enumerate(trials)
        for name in names
        if name in trial and (one := unwrapped(name, trial.time, trial[name], trial.columns.get("velocity")))
    }
    out = list(trials)
    for (k, name), one in found.items():
        others = [middle(t[name]) for j, t in enumerate(trials) if name in t and (j, name) not in found]
        trial = out[k]
        moved = one.near(float(np.median(others)) if others else 0.0)
        if name == "position" and "position0" in trial.conditions:
            moved = moved - one.period * round((moved[0] - trial.conditions["position0"]) / one.period)
        out[k] = _replaced(trial, name, moved, one.said)
    return tuple(out)


def _replaced(trial: Trial, name: str, values: np.ndarray, said: str) -> Trial:
    """Return a trial as it would have been read with other values of a column."""
    made = derived_trial(trial, columns={**trial.columns, name: values}, remarks=(*trial.remarks, said))
    if trial.as_read is None or trial.is_edited:
        return made
    return derived_trial(made, as_read=replace(trial.as_read, digest=made.digest()))
