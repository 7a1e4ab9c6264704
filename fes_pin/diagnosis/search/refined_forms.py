"""Identifiability of the refinements of a model's effects."""

import numpy as np

from fes_pin.identify.fit import Fit
from fes_pin.infer.levels import CONFIDENCE_95


def is_identified(fitted: Fit, before: Fit | None = None) -> bool:
    """Return whether every parameter of all refined effects differs significantly from its null, within its bounds.

    Parameters
    ----------
    before
        The fit that was refined: a parameter that was at its bound there is no objection to another form.
    """
    there = before.at_bound if before is not None else ()
    for one in fitted.model.effects:
        if not one.refined():
            continue
        for n, info in one.parameters().items():
            name = f"{one.name}.{n}"
            if name not in fitted.free or name in there:
                continue
            if name in fitted.at_bound:
                return False
            std, away = fitted.std(name), getattr(one, n) - info.null if info.null is not None else np.inf
            if not np.isfinite(std) or abs(away) < CONFIDENCE_95 * std:
                return False
    return True
