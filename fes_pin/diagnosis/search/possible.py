"""Sizes of causes that are physically impossible, however well they fit."""

from collections.abc import Mapping

import numpy as np

from fes_pin.identify.fit import Fit


def is_possible(fitted: Fit, measured: Mapping[str, np.ndarray]) -> bool:
    """Return False if a cause in a fit is impossible: another cause is then mistaken for it.

    It is impossible if its size or shape ended at a bound other than its null, or if its size is less than the readings
    can resolve.

    Parameters
    ----------
    measured
        Columns of the trials; see `identify.problem.measured_columns`, and `answered_columns` for a rig in closed loop.
    """
    for effect in fitted.model.effects:
        info, smallest = effect.parameters(), effect.smallest(measured)
        for n in (*effect.amplitudes(), *effect.shapes()):
            size = getattr(effect, n)
            if f"{effect.name}.{n}" in fitted.at_bound and size != info[n].null:
                return False
            if 0.0 < abs(size) < smallest.get(n, 0.0):
                return False
    return True
