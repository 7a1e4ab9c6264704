"""How far the engine's nominal model misses noiseless readings: all that the generator asks of the engine.

Imported only where a study is made, so that other versions of the package answer studies that were made before.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from confusion_matrix.drafts import Draft, study_of
from confusion_matrix.noise import LEVEL
from fes_pin.data.study import Study
from fes_pin.identify.fit import Fit, fit_problem
from fes_pin.identify.problem import Problem
from fes_pin.infer.noise import Noise
from fes_pin.models.model import Model
from fes_pin.models.nominal import nominal_model

WHITE = {name: Noise(level, (), level, 0.0) for name, level in LEVEL.items()}


def noncentrality(one: Draft, readings: list[np.ndarray]) -> float:
    """Root of what noiseless readings leave after the nominal refit, in units of white noise at the true level."""
    if not all(np.isfinite(y).all() for y in readings):
        return float("inf")
    fitted = nominal_fit(study_of(one, readings), one.plant.true)
    return float(np.sqrt(fitted.sse))


def nominal_fit(study: Study, true: Mapping[str, float], model: Model | None = None) -> Fit:
    """Fit a study's nominal model, or one that extends it, from the true values."""
    extended = model or nominal_model(study)
    with np.errstate(all="ignore"):
        return fit_problem(Problem(extended, study.trials, WHITE), {**extended.parameters(), **true})
