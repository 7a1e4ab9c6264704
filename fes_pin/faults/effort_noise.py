"""Noise of recorded efforts.

A measured current has noise of its own, which moves nothing. A filter takes it for effort: a rig in closed loop then
seems to move less than the recorded effort would move it, as if dry friction held it. The effort that the controller
computes from its reading separates the noise from the effort that acted (`data.answered`); the likelihood of a model
estimates how much noise there is.
"""

import time
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TypeVar

import numpy as np

from fes_pin.data.answered import ControllerAnswer
from fes_pin.data.log import answered, quiet
from fes_pin.data.trial import Trial
from fes_pin.identify.likelihood_fit import LikelihoodFit, maximum_from
from fes_pin.infer.levels import CERTAIN_GAIN, EFFORT_NOISE_SHARE
from fes_pin.models.model import Model
from fes_pin.search.likelihood_fits import LikelihoodFits
from fes_pin.workers import attempted, in_parallel

T = TypeVar("T")
Prepared = Callable[[Sequence[Trial]], Sequence[Trial]]
"""Preparation of recorded trials before a search fits them."""
TRIED = (0.1, 0.25, 0.5, 0.75)
"""Quantiles of the residual between recorded and computed effort that are tried as the noise. Noise has the same size
everywhere, while other errors of the computed effort do not: they are small in a share of the samples."""


class EffortNoise:
    """Estimates of the noise of the efforts that drive a rig.

    Parameters
    ----------
    trials
        All trials as recorded, held-out ones included.
    prepared
        Preparation of trials before they are fitted.
    end
        Time at which searches stop, of `time.perf_counter`.

    Attributes
    ----------
    nominal
        The fit of the nominal model to the trials as recorded, once it was made.
    """

    nominal: LikelihoodFit | None = None

    def __init__(self, trials: Sequence[Trial], prepared: Prepared, end: float) -> None:
        self.trials, self.prepared, self._end = tuple(trials), prepared, end

    @cached_property
    def answers(self) -> list[ControllerAnswer]:
        """The controller that each trial's effort follows."""
        return in_parallel(answered, self.trials)

    def of_nominal(self, nominal: Model) -> float:
        """Return the noise of recorded efforts under the nominal model, in their unit; 0 where it is not supported."""

        def certain() -> float:
            self.nominal = LikelihoodFits(nominal, self.prepared(self.trials), ()).nominal()
            noise, gain = self.of(self.nominal)
            return noise if gain > CERTAIN_GAIN else 0.0

        return self.in_time(certain, 0.0)

    def of(self, fitted: LikelihoodFit) -> tuple[float, float]:
        """Return the likeliest noise of recorded efforts under a fit to the prepared trials, and its gain; 0 of none.

        The gain is in twice the log-likelihood.
        """
        left = np.concatenate([a.left_std for a in self.answers])
        std, time_s = (part.get("effort", 0.0) for part in (fitted.noise.std, fitted.noise.time))
        least = np.sqrt(EFFORT_NOISE_SHARE * 2.0 * std**2 * time_s / min(t.dt for t in self.trials))
        tried = [0.0, *(float(v) for v in np.unique(np.quantile(left, TRIED)) if v > least)]
        if len(tried) == 1:
            return 0.0, 0.0
        costs = in_parallel(lambda noise: maximum_from(fitted, self.prepared(self._quieted(noise))).sse, tried)
        best = int(np.argmin(costs))
        return tried[best], float(costs[0] - costs[best])

    def _quieted(self, noise: float) -> list[Trial]:
        """Return the trials with noise of that size removed from their efforts."""
        return [quiet(t, a, noise) for t, a in zip(self.trials, self.answers, strict=True)]

    def in_time(self, ask: Callable[[], T], otherwise: T) -> T:
        """Return an estimate, or another value if it is not finite or time is over."""
        return attempted(ask, otherwise, self._end - time.perf_counter())


def words_of_noise(noise: float, unit: str) -> str:
    """Return a warning about efforts from which noise was removed."""
    return f"the effort was recorded with noise of {noise:.2g} {unit}: it was removed where readings predict the effort"
