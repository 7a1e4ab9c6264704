"""With how much noise an effort was recorded.

A measured current has noise of its own, which moves nothing. A filter takes it for effort: a rig that a controller
holds seems to be moved less than by what is recorded, as dry friction would have it. What a controller answers tells
the noise from what acted (`data.answered`); how much of it there is the likelihood says, beside a model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fes_pin.data.answered import ControllerAnswer
from fes_pin.data.log import quiet
from fes_pin.data.trial import Trial
from fes_pin.identify.likelihood_fit import LikelihoodFit, maximum_from
from fes_pin.infer.levels import CERTAIN_GAIN, EFFORT_NOISE_SHARE
from fes_pin.workers import in_parallel

TRIED = (0.1, 0.25, 0.5, 0.75)
"""Shares of the samples whose answer leaves less than a noise that is tried: noise is the same everywhere, and what it
is not foretold by is not, so that where an answer is known at all it leaves little else."""

Prepared = Callable[[Sequence[Trial]], Sequence[Trial]]
"""What a search makes of recorded trials before it fits them."""


def effort_noise_of(
    fitted: LikelihoodFit, trials: Sequence[Trial], answers: Sequence[ControllerAnswer], prepared: Prepared
) -> float:
    """Standard deviation of the noise of an effort, in its unit; 0 where nothing speaks for one.

    Parameters
    ----------
    fitted
        By the likelihood, to what `prepared` makes of the trials.
    trials, answers
        As recorded, and what their efforts answer.
    """
    left = np.concatenate([a.left_std for a in answers])
    tried = [0.0, *(float(v) for v in np.unique(np.quantile(left, TRIED)) if v > _least(fitted, trials))]
    if len(tried) == 1:
        return 0.0
    costs = in_parallel(lambda noise: maximum_from(fitted, prepared(quieted(trials, answers, noise))).sse, tried)
    best = int(np.argmin(costs))
    return tried[best] if costs[best] < costs[0] - CERTAIN_GAIN else 0.0


def _least(fitted: LikelihoodFit, trials: Sequence[Trial]) -> float:
    """The least noise that is anything beside the random effort of a fit, in the effort's unit."""
    std, time = (part.get("effort", 0.0) for part in (fitted.noise.std, fitted.noise.time))
    return float(np.sqrt(EFFORT_NOISE_SHARE * 2.0 * std**2 * time / min(t.dt for t in trials)))


def quieted(trials: Sequence[Trial], answers: Sequence[ControllerAnswer], noise: float) -> list[Trial]:
    """The trials without so much noise of their efforts."""
    return [quiet(t, a, noise) for t, a in zip(trials, answers, strict=True)]


def words_of_noise(noise: float, unit: str) -> str:
    """What is to be said of efforts whose noise was taken out."""
    return (
        f"the effort was recorded with noise of {noise:.2g} {unit}, which was taken out where the readings foretell it"
    )
