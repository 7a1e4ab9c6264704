"""Choice of the set of causes that predicts best, where every set has a lack of fit.

Likelihoods then compare wrong models, and a flexible one may win by overfitting single trials. A cause must improve the
prediction of trials that it was not fitted to.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.held_out import folds_that_tell
from fes_pin.diagnosis.likelihood_models import LikelihoodSearch
from fes_pin.identify.ahead import free_residuals
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.identify.problem import limits_of
from fes_pin.infer.fits import Names
from fes_pin.infer.left_out import LeftOut
from fes_pin.infer.levels import FORM_SHARE
from fes_pin.infer.optimum import minimise
from fes_pin.models.model import Model
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.workers import in_parallel

POOL = 6
"""Sets of each size that are compared by prediction."""
FEWEST = 3
"""Least number of trials by which sets are compared."""


def best_predicting(search: LikelihoodSearch, names: Names) -> Names:
    """Return the smallest set whose error on trials left out exceeds the least by no more than an error of form.

    It is the set that was found where none can be left out. A set is not tried if its error on the trials that it is
    fitted to is larger than that of another on trials left out.

    Parameters
    ----------
    search
        A search that has run without process noise.
    names
        The set that it found.
    """
    models = search.models
    folds = folds_that_tell(models.fits[names])
    if not folds:
        return names
    ranked = [n for k in sorted({len(n) for n in models.fits}) for n in models.ranked(k)[:POOL]]
    pool = [n for n in dict.fromkeys([names, *ranked]) if models.is_possible(models.fits[n])]
    noise = models.fits[()].noise
    own = in_parallel(lambda n: _error(models.fits[n].model, models.trials, noise), pool)
    inside = dict(zip(pool, own, strict=True))
    errors: dict[Names, float] = {}
    for one in sorted(pool, key=lambda n: (inside[n], n)):
        if errors and inside[one] > min(errors.values()) + FORM_SHARE:
            break
        errors[one] = prediction_error(models.fits[one], noise, folds)
    good = [n for n in errors if errors[n] <= min(errors.values()) + FORM_SHARE]
    return min(good, key=lambda n: (len(n), errors[n], n))


def prediction_error(fitted: LikelihoodFit, noise: StateSpaceNoise, folds: Sequence[Sequence[int]]) -> float:
    """Return the logarithm of the mean squared error of simulations of trials left out in turn, averaged over trials.

    The logarithm keeps one large motion from deciding alone. The fit without some trials is approximated by one
    Gauss-Newton step from the fit to all. Unknowns of a trial, as its initial state, are
    estimated from that trial.

    Parameters
    ----------
    noise
        Its standard deviations are the unit of errors.
    folds
        Numbers of the trials that are left out together.
    """

    units, limits = LeftOut(fitted), limits_of(fitted.model, fitted.trials)

    def left_out(held: Sequence[int]) -> tuple[float, int]:
        moved = {n: float(np.clip(v, *limits[n])) for n, v in units.values(held).items()}
        trials = [fitted.trials[i] for i in held]
        return _error(fitted.model.with_parameters(moved), trials, noise), len(held)

    means, counts = zip(*in_parallel(left_out, folds), strict=True)
    return float(np.average(means, weights=counts))


def _error(model: Model, trials: Sequence[Trial], noise: StateSpaceNoise) -> float:
    """Return the mean over trials of the logarithm of the mean squared error of a simulation."""
    if model.own_unknowns():
        missed = [free_residuals(model, t, noise) for t in trials]
        residuals = [np.concatenate([v[np.isfinite(v)] / noise.white[n] for n, v in one.items()]) for one in missed]
    else:
        problem = LikelihoodProblem(model, trials, replace(noise, ar={}), ())
        residuals = [p.residual for p in minimise(problem, model.parameters()).parts]
    means = [float(r @ r) / max(len(r), 1) for r in residuals]
    return float(np.mean([math.log(max(m, 1e-12)) if math.isfinite(m) else math.inf for m in means]))
