"""Whether the data tell what a refinement of the form of a model's effect adds."""

from __future__ import annotations

import numpy as np

from fes_pin.identify.fit import Fit
from fes_pin.infer.levels import CONFIDENCE_95


def is_identified(fitted: Fit, before: Fit | None = None) -> bool:
    """True if the data tell every parameter that has a null from it, within its bounds, in all refined effects.

    Parameters
    ----------
    before
        The fit that was refined: what stood at its bound there already speaks not against another form.
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
