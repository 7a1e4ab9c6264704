"""How long the noise of a reading lasts: over samples, where a record was smoothed or interpolated.

The filter takes the noise of each reading for new. Noise that lasts it follows as it does motion, by a random effort
that nothing exerts, and inertia is what that effort makes of it. Readings as far apart as their noise is new have
innovations that are white; and every second of them tells of the same noise, the same random effort and the same rig as
all do. Where they do not, readings are taken twice as far apart.

Innovations are white if they correlate little with the next two. A model that misses a cause brings a correlation of
0.02 at the steps of a recording; noise that was averaged over ten samples brings 0.5
(`tests/driven/test_correlation_time.py`).
A correlation of `SMALL_SHARE` is worth its square in twice the log-likelihood of a reading: by no more may every second
reading fit better by itself.
"""

from __future__ import annotations

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
"""Readings that every trial keeps."""


def with_new_noise(trials: Sequence[Trial], nominal: Callable[[float], LikelihoodFit]) -> LikelihoodFit:
    """The nominal fit with readings as near to each other as their noise is new.

    Parameters
    ----------
    nominal
        The nominal model's fit where the noise of a reading is taken to last so long, s.

    Returns
    -------
    Fit
        Its `noise.correlation_s` is the correlation time; 0 where the noise of every sample is new. Where it is new at
        no spacing, the fit whose innovations correlate least with the next.
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
    """The larger correlation of an innovation with one of the next two; trials weigh as they are long."""
    residuals = [p.residual for p in fitted.parts]
    power = sum(float(r @ r) for r in residuals)
    along = [abs(sum(float(r[k:] @ r[:-k]) for r in residuals)) for k in (1, 2)]
    return max(along) / max(power, 1e-300)


def _other(fitted: LikelihoodFit, sparser: LikelihoodFit) -> float:
    """By how much less likely sparser readings are, each, under a fit than under their own."""
    problem = LikelihoodProblem(sparser.model, sparser.trials, sparser.noise)
    as_it_was = replace(fitted.noise, correlation_s=sparser.noise.correlation_s)
    lost = problem.cost(fitted.values, fitted.unknowns, as_it_was) - sparser.sse
    return lost / max(sum(len(p.residual) for p in sparser.parts), 1)


__all__ = ["with_new_noise"]


def words_of_reading(noise: NoiseModel, rig: Rig, trials: Sequence[Trial]) -> tuple[str, ...]:
    """What is to be said of a reading that hunts, or whose noise lasts over samples.

    Neighbours that stand on one count err alike; else a record was smoothed. Readings that hunt are followed, and not
    judged (`hunts`).
    """
    name = rig.output(trials[0].kind)
    columns = [t[name] for t in trials if name in t.columns]
    count = max(map(count_of, columns), default=0.0)
    said = []
    hunting = sum(int(hunts(c).sum()) for c in columns) / max(sum(map(len, columns)), 1)
    if hunting > SMALL_SHARE:
        share = f"{100 * hunting:.0f} % of its samples"
        said.append(f"{name} goes to and fro between two counts in {share}: these are followed, and judge nothing")
    if isinstance(noise, StateSpaceNoise) and noise.correlation_s:
        step = round(noise.correlation_s / trials[0].dt)
        read = f"is read in counts of {count:.2g}" if count else "was smoothed or interpolated before it was stored"
        words = f"its noise lasts {noise.correlation_s:.2g} s, and one sample in {step} counts as a reading"
        said.append(f"{name} {read}: {words}")
    return tuple(said)
