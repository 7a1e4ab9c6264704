"""What is done where no set of causes leaves only noise: sets are judged, and models fitted, by prediction."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.decide.claims import FORM_SHARE
from fes_pin.diagnosis.decide.held_out import folds_of, foretold
from fes_pin.diagnosis.search.cause_sets import Names
from fes_pin.diagnosis.search.model_fitter import FIRST_ITERATIONS
from fes_pin.diagnosis.search.simulation_fits import SimulationFits
from fes_pin.identify.fit import Fit, fit_problem, go_on, noise_of
from fes_pin.identify.problem import Problem
from fes_pin.infer.noise import NoiseModel, as_white
from fes_pin.workers import in_parallel

REFINED = 3
"""Best sets by prediction whose forms are tried refined."""


def choose_by_prediction(sets: SimulationFits, names: Names, pool: Sequence[Names]) -> Names:
    """Choose by open-loop errors on trials left out.

    Where no set leaves only noise likelihoods compare wrong models, and a flexible one can win by what it does to
    single trials; a cause must help on trials that it was not fitted to. A set that does worse on the trials it is
    fitted to than another does on trials left out is not tried.
    """
    if len(sets.trials) < 3:
        return names
    near = dict(zip(pool, in_parallel(lambda n: open_loop(sets.fits[n]), pool), strict=True))
    errors: dict[Names, float] = {}
    for one in sorted(near, key=lambda n: (_mean_logarithm(_residuals(near[n])), n)):
        if errors and _mean_logarithm(_residuals(near[one])) > min(errors.values()) + FORM_SHARE:
            break
        errors[one] = predictive_error(near[one])
    for one in sorted(errors, key=lambda n: (errors[n], n))[:REFINED]:
        refined = sets.refinement(one)
        if refined is not None and (error := predictive_error(open_loop(refined))) < errors[one] - FORM_SHARE:
            sets.fits[one], errors[one] = refined, error
    least = min(errors.values())
    good = [n for n in errors if errors[n] <= least + FORM_SHARE]
    return min(good, key=lambda n: (len(n), errors[n], n))


def open_loop(fitted: Fit) -> Fit:
    """The same model fitted for least open-loop error: its residuals are misfit, and not to be whitened."""
    problem = Problem(fitted.model, fitted.trials, as_white(fitted.noise))
    return go_on(problem, fitted, 2 * FIRST_ITERATIONS)


def predictive_error(near: Fit) -> float:
    """Logarithm of the mean squared error on trials left out in turn, averaged over trials.

    Fits are for least open-loop error, and each trial's own unknowns are estimated from it; the logarithm keeps one
    large motion from deciding alone.

    Parameters
    ----------
    near
        Fit for least open-loop error to all trials.
    """

    def left_out(held: list[int]) -> list[np.ndarray]:
        train = [i for i in range(len(near.trials)) if i not in held]
        again = go_on(Problem(near.model, [near.trials[i] for i in train], near.noise), near, 2 * FIRST_ITERATIONS)
        alone = [Problem(again.model, [near.trials[i]], near.noise, ()) for i in held]
        return [foretold(fit_problem(p, again.values, [near.unknowns[i]])) for p, i in zip(alone, held, strict=True)]

    return _mean_logarithm([one for fold in in_parallel(left_out, folds_of(near.trials)) for one in fold])


def _residuals(fitted: Fit) -> list[np.ndarray]:
    return [p.residual for p in fitted.parts]


def _mean_logarithm(residuals: Sequence[np.ndarray]) -> float:
    """Of the mean squared whitened residual, over trials."""
    means = [float(r @ r) / max(len(r), 1) for r in residuals]
    return float(np.mean([math.log(max(m, 1e-12)) if math.isfinite(m) else math.inf for m in means]))


def fit_for_prediction(fits: Sequence[Fit], recorded: Sequence[Trial]) -> list[Fit]:
    """Fit models for least open-loop error, to trials as recorded, under the noise of the first.

    Each trial's initial state is estimated, though a prediction takes its first sample: the noise of a first sample
    would go into the parameters.
    """
    return under_one_noise(fits, recorded, as_white(noise_of(fits[0])))


def under_one_noise(fits: Sequence[Fit], trials: Sequence[Trial], noise: NoiseModel) -> list[Fit]:
    """The same models fitted to the same trials under one noise, so that they can be compared."""
    return in_parallel(lambda f: fit_problem(Problem(f.model, trials, noise), f.values), fits)
