"""Test for torque that is periodic in the angle over short distances, as of detents: a scan over its wave number."""

import numpy as np

from fes_pin.identify.fit import Fit
from fes_pin.identify.problem import Problem
from fes_pin.infer.covariance import least_squares_step
from fes_pin.infer.distributions import chi2_quantile, chi2_tail
from fes_pin.infer.projection import Projection
from fes_pin.models.features import SHORT_WAVES, AngleWaves, scaled_to
from fes_pin.models.model import Model


def detent_p_value(fitted: Fit, projection: Projection) -> float:
    """Return the p-value of the strongest short wave of torque in the angle; 1 where no joint moves.

    The score of each wave number, in a model whose fitted parameters are free too, is chi-square of two degrees. All
    are divided by their median over its expectation, since noise that is not quite whitened raises them all.
    """
    rig = fitted.model.rig
    moving = [t for t in fitted.trials if "torque" in rig.signals(t.kind)]
    if not moving:
        return 1.0
    model = Model(rig, (scaled_to(AngleWaves(), rig, moving),))
    free = tuple(f"{AngleWaves.name}.{n}" for n in AngleWaves.amplitudes())
    values = {n: fitted.values.get(n, v) for n, v in model.parameters().items()}
    parts = Problem(model, fitted.trials, fitted.noise, free).linearize(values, fitted.unknowns)
    left = projection(np.concatenate([p.jacobian for p in parts]))
    pairs = [left[:, 2 * j : 2 * j + 2] for j in range(len(SHORT_WAVES))]
    along = [pair.T @ projection.residual for pair in pairs]
    scores = [float(a @ least_squares_step(pair.T @ pair, a)) for a, pair in zip(along, pairs, strict=True)]
    inflation = max(1.0, float(np.median(scores)) / float(chi2_quantile(0.5, 2)))
    return min(1.0, len(scores) * float(chi2_tail(max(scores) / inflation, 2)))
