"""What a cause cannot be, however well it fits."""

from __future__ import annotations

from fes_pin.identify.fit import Fit
from fes_pin.identify.problem import answered_columns, measured_columns


def is_possible(fitted: Fit) -> bool:
    """False if the size of a cause is nothing that it can be: it stands for another.

    It ended where that ends, other than at nothing, or is less than what is read can tell.
    """
    if not fitted.model.effects:
        return True
    columns = measured_columns if fitted.doubt is None else answered_columns
    measured = columns(fitted.model, fitted.trials)
    for effect in fitted.model.effects:
        info, smallest = effect.parameters(), effect.smallest(measured)
        for n in effect.amplitudes():
            size = getattr(effect, n)
            if f"{effect.name}.{n}" in fitted.at_bound and size != info[n].null:
                return False
            if 0.0 < abs(size) < smallest.get(n, 0.0):
                return False
    return True
