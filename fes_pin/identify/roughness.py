"""How rough the likelihood is about a fit: what its cost differs by between points that the data cannot tell apart.

The likelihood of a model that bends sharply is that of an approximate filter, and may jump by more than what a
parameter's deviation is worth: that of a play did, before what its slack cuts was carried (`compile.slack`). Where a
fit ends there is chance, and of two fits nothing is said by less than that.
"""

from __future__ import annotations

import numpy as np

from fes_pin.identify.fit import Fit
from fes_pin.identify.levels import SURE
from fes_pin.identify.likelihood import LikelihoodProblem

NEAR = 0.5
"""Deviations of a parameter that points are away from the fit: its square is what a smooth cost rises by."""


def roughness(fitted: Fit) -> float:
    """Root mean square of what the cost rises by other than a parabola, half a deviation along its axes.

    In twice the log-likelihood, of a fit by it; 0 where no parameter is known, or the cost is no number.
    """
    assert fitted.doubt is not None
    known = np.isfinite(np.diag(fitted.covariance)) & (np.diag(fitted.covariance) > 0.0)
    if not known.any() or not np.isfinite(fitted.sse):
        return 0.0
    sizes, axes = np.linalg.eigh(fitted.covariance[np.ix_(known, known)])
    steps = NEAR * (axes * np.sqrt(np.maximum(sizes, 0.0))).T
    names = [n for n, k in zip(fitted.free, known, strict=True) if k]
    here = np.array([fitted.values[n] for n in names])
    problem = LikelihoodProblem(fitted.model, fitted.trials, fitted.doubt, fitted.free)
    moved = np.clip(here + np.concatenate([steps, -steps]), *np.transpose([problem.limits[n] for n in names]))
    points = [({**fitted.values, **dict(zip(names, map(float, one), strict=True))}, fitted.unknowns) for one in moved]
    costs = np.array(problem.bounds(points))
    rises = costs[np.isfinite(costs)] - fitted.sse - NEAR**2
    return float(np.sqrt(np.mean(rises**2))) if len(rises) else 0.0


def uncertain_gain(*rough: float) -> float:
    """What fits as rough may differ by in twice the log-likelihood, each half way down what it jumps by, by chance."""
    return SURE * float(np.sqrt(0.5 * np.sum(np.square(rough))))
