"""Noise with which an effort was recorded.

A measured current has noise of its own, which moves nothing. A filter takes it for effort: a rig in closed loop then
seems to move less than the recorded effort would move it, as if dry friction held it. The effort that the controller
computes from its reading separates the noise from the effort that acted (`data.answered`); the likelihood of a model
estimates how much noise there is.
"""

from collections.abc import Callable, Sequence

import numpy as np

from fes_pin.data.answered import ControllerAnswer
from fes_pin.data.log import quiet
from fes_pin.data.trial import Trial
from fes_pin.identify.likelihood_fit import LikelihoodFit, maximum_from
from fes_pin.infer.levels import CERTAIN_GAIN, EFFORT_NOISE_SHARE
from fes_pin.workers import in_parallel

TRIED = (0.1, 0.25, 0.5, 0.75)
"""Quantiles of the residual between recorded and computed effort that are tried as the noise. Noise has the same size
everywhere, while other errors of the computed effort do not: they are small in a share of the samples."""

Prepared = Callable[[Sequence[Trial]], Sequence[Trial]]
"""Preparation of recorded trials before a search fits them."""


def effort_noise_of(
    fitted: LikelihoodFit, trials: Sequence[Trial], answers: Sequence[ControllerAnswer], prepared: Prepared
) -> float:
    """Return the standard deviation of the noise of an effort, in its unit; 0 where the likelihood supports none.

    Parameters
    ----------
    fitted
        A fit by the likelihood to the prepared trials.
    trials, answers
        Trials as recorded, and the controllers that their efforts follow.
    """
    left = np.concatenate([a.left_std for a in answers])
    tried = [0.0, *(float(v) for v in np.unique(np.quantile(left, TRIED)) if v > _least(fitted, trials))]
    if len(tried) == 1:
        return 0.0
    costs = in_parallel(lambda noise: maximum_from(fitted, prepared(quieted(trials, answers, noise))).sse, tried)
    best = int(np.argmin(costs))
    return tried[best] if costs[best] < costs[0] - CERTAIN_GAIN else 0.0


def _least(fitted: LikelihoodFit, trials: Sequence[Trial]) -> float:
    """Return the least noise that matters against the process noise of a fit, in the effort's unit."""
    std, time = (part.get("effort", 0.0) for part in (fitted.noise.std, fitted.noise.time))
    return float(np.sqrt(EFFORT_NOISE_SHARE * 2.0 * std**2 * time / min(t.dt for t in trials)))


def quieted(trials: Sequence[Trial], answers: Sequence[ControllerAnswer], noise: float) -> list[Trial]:
    """Return the trials with noise of that size removed from their efforts."""
    return [quiet(t, a, noise) for t, a in zip(trials, answers, strict=True)]


def words_of_noise(noise: float, unit: str) -> str:
    """Return a warning about efforts from which noise was removed."""
    return f"the effort was recorded with noise of {noise:.2g} {unit}: it was removed where readings predict the effort"
