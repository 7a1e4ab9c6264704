"""What a cause cannot be, however well it fits."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fes_pin.identify.fit import Fit


def is_possible(fitted: Fit, measured: Mapping[str, np.ndarray]) -> bool:
    """False if the size of a cause of a fit is nothing that it can be: another cause is mistaken for it.

    The size ended at its bound, other than at nothing, or is less than the readings can resolve.

    Parameters
    ----------
    measured
        Columns of the trials; see `identify.problem.measured_columns`, and `answered_columns` where a controller
        answers the reading.
    """
    for effect in fitted.model.effects:
        info, smallest = effect.parameters(), effect.smallest(measured)
        for n in effect.amplitudes():
            size = getattr(effect, n)
            if f"{effect.name}.{n}" in fitted.at_bound and size != info[n].null:
                return False
            if 0.0 < abs(size) < smallest.get(n, 0.0):
                return False
    return True
