"""Correlation time of measurement noise: longer than a sample where a record was smoothed or interpolated.

The filter assumes that the noise of each reading is independent. It would follow correlated noise as it follows motion,
by process noise that does not exist, and inertia would be biased. Readings that are a correlation time apart have white
innovations, and every second of them gives the same noise and the same model as all. Where that does not hold, the
spacing of readings is doubled.

Innovations are white if they correlate little with the next two. A model that misses a cause brings a correlation of
0.02 at the steps of a recording; noise that was averaged over ten samples brings 0.5
(`tests/driven/test_correlation_time.py`). A correlation of `SMALL_SHARE` changes twice the log-likelihood of a reading
by its square: every second reading by itself may fit better by no more.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from fes_pin.data.counts import count_of, hunts
from fes_pin.data.trial import Trial
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.levels import SMALL_SHARE
from fes_pin.infer.noise import NoiseModel
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.models.rigs.base import Rig

FEWEST = 30
"""Least number of readings that every trial keeps."""


def with_new_noise(trials: Sequence[Trial], nominal: Callable[[float], LikelihoodFit]) -> LikelihoodFit:
    """Return the nominal fit at the smallest spacing of readings at which measurement noise is white.

    Parameters
    ----------
    nominal
        Returns the nominal fit at a correlation time, s.

    Returns
    -------
    Fit
        Its `noise.correlation_s` is the correlation time; 0 where the noise of all samples is white. Where it is white
        at no spacing, the fit whose innovations correlate least with the next.
    """
    now = nominal(0.0)
    if not all(now.model.rig.unknowns(t.kind) for t in trials):  # a force may be as smooth as its reading
        return now
    step, tried = 1, [(math.inf, now)]
    while 2 * step * FEWEST <= min(map(len, trials)):
        step *= 2
        sparser = nominal(step * max(t.dt for t in trials))
        tried.append((_shared(now), now))
        if tried[-1][0] < SMALL_SHARE and _other(now, sparser) < SMALL_SHARE**2:
            return now
        now = sparser
    return min(tried, key=lambda one: one[0])[1]


def _shared(fitted: LikelihoodFit) -> float:
    """Return the larger correlation of an innovation with one of the next two; trials weigh by their length."""
    residuals = [p.residual for p in fitted.parts]
    power = sum(float(r @ r) for r in residuals)
    along = [abs(sum(float(r[k:] @ r[:-k]) for r in residuals)) for k in (1, 2)]
    return max(along) / max(power, 1e-300)


def _other(fitted: LikelihoodFit, sparser: LikelihoodFit) -> float:
    """Return by how much less likely each sparser reading is under a fit than under the fit of these readings."""
    as_it_was = replace(fitted.noise, correlation_s=sparser.noise.correlation_s)
    problem = LikelihoodProblem(sparser.model, sparser.trials, as_it_was)
    lost = problem.cost(fitted.values, fitted.unknowns) - sparser.sse
    return lost / max(sum(len(p.residual) for p in sparser.parts), 1)


def words_of_reading(noise: NoiseModel, rig: Rig, trials: Sequence[Trial]) -> tuple[str, ...]:
    """Return warnings about a reading that hunts between counts, or whose noise is correlated over samples.

    Noise is correlated where neighbours share a count, or where a record was smoothed. Readings that hunt are followed
    by the filter and do not enter the likelihood (`hunts`).
    """
    name = rig.output(trials[0].kind)
    columns = [t[name] for t in trials if name in t.columns]
    count = max(map(count_of, columns), default=0.0)
    said = []
    hunting = sum(int(hunts(c).sum()) for c in columns) / max(sum(map(len, columns)), 1)
    if hunting > SMALL_SHARE:
        share = f"{100 * hunting:.0f} % of its samples"
        said.append(f"{name} alternates between two counts in {share}: these do not enter the likelihood")
    if isinstance(noise, StateSpaceNoise) and noise.correlation_s:
        step = round(noise.correlation_s / trials[0].dt)
        read = f"is read in counts of {count:.2g}" if count else "was smoothed or interpolated before it was stored"
        words = f"its noise is correlated over {noise.correlation_s:.2g} s: one sample in {step} counts as a reading"
        said.append(f"{name} {read}: {words}")
    return tuple(said)
