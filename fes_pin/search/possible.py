"""Sizes of causes that are physically impossible, however well they fit."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from fes_pin.identify.fit import Fit
from fes_pin.infer.levels import CONFIDENCE_95, SMALL_SHARE
from fes_pin.models.stage import Effect


def is_possible(fitted: Fit, measured: Mapping[str, np.ndarray]) -> bool:
    """Return False if a cause in a fit is impossible: another cause is then mistaken for it.

    It is impossible if its size or shape ended at a bound other than its null or 0, if its size is less than the
    readings can resolve, or if it is a gain that leaves hardly anything: something else then moves the rig, not the
    recorded effort.

    Parameters
    ----------
    measured
        Columns of the trials; see `identify.problem.measured_columns`, and `answered_columns` for a rig in closed loop.
    """
    return are_possible(fitted.model.effects, fitted.at_bound, measured)


def are_possible(effects: Sequence[Effect], at_bound: Collection[str], measured: Mapping[str, np.ndarray]) -> bool:
    """Return False if a cause of a model is impossible: see `is_possible`; `at_bound` are "cause.parameter"."""
    for effect in effects:
        info, smallest = effect.parameters(), effect.smallest(measured)
        for n in (*effect.amplitudes(), *effect.shapes()):
            size = getattr(effect, n)
            is_stuck = f"{effect.name}.{n}" in at_bound and size not in (info[n].null, 0.0) and n not in effect.may_end
            is_void = effect.scales and n in effect.amplitudes() and abs(1.0 + size) < SMALL_SHARE
            if is_stuck or is_void or 0.0 < abs(size) < smallest.get(n, 0.0):
                return False
    return True


def is_certain(fitted: Fit, effect: Effect) -> bool:
    """Return whether a size of a cause is twice its deviation from its null; True of one of each trial's own."""
    names = {n: f"{effect.name}.{n}" for n in effect.amplitudes() if f"{effect.name}.{n}" in fitted.free}
    away = (abs(getattr(effect, n) - effect.nulls()[n]) / max(fitted.std(path), 1e-300) for n, path in names.items())
    ended = {n: p for n, p in names.items() if p in fitted.at_bound and n in effect.may_end}
    reached = (abs(getattr(effect, n)) > fitted.reach(p) for n, p in ended.items())
    return not names or any(reached) or any(ratio > CONFIDENCE_95 for ratio in away)
