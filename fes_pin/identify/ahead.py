"""Errors of a model one sample ahead, over a horizon, and free: three answers to one question.

One sample ahead any model is right where sampling is fast; free simulation goes astray where a rig integrates or falls,
with the best of models; over a horizon in between a model is tried for what it is used for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.models.model import Model
from fes_pin.models.predictor import Doubt, masked
from fes_pin.models.simulate import Simulator

HORIZON_S = 0.3
"""How far ahead a horizon looks by default, s, or a tenth of the shortest trial if that is less."""
STRIDE = 0.25
"""Of the horizon: how much older than asked the newest sample that a prediction uses may be."""
AT_ONCE = 64
"""Predictions that are made side by side: a bound on memory."""
GROWTH = 100.0
"""Factor by which a free simulation may enlarge an error of its first sample before it says nothing of the model."""


def default_horizon(trials: Sequence[Trial]) -> float:
    """`HORIZON_S`, or a tenth of the shortest trial; all of the longest where every motion is imposed."""
    if all(t.kind == IMPOSED for t in trials):
        return max(t.duration for t in trials)
    return min(HORIZON_S, 0.1 * min(t.duration for t in trials))


def one_step(model: Model, trial: Trial, doubt: Doubt) -> dict[str, np.ndarray]:
    """Measured minus foretold one sample ahead, shape (n,), by output column."""
    problem = LikelihoodProblem(model, [trial], doubt, ())
    (one,) = problem.innovations(model.parameters(), problem.start_unknowns())
    return {n: one.values[:, k] for k, n in enumerate(one.outputs)}


def over_horizon(model: Model, trial: Trial, doubt: Doubt, horizon_s: float) -> dict[str, np.ndarray]:
    """What a model foretells of each sample from what was measured up to `horizon_s` before it.

    Parameters
    ----------
    horizon_s
        s; the newest sample that is used may be older by a quarter of it. Before that much time has passed, predictions
        begin at the first sample.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        By output column that the trial has.
    """
    ahead = max(1, round(horizon_s / trial.dt))
    stride = max(1, round(STRIDE * ahead))
    outputs = tuple(n for n in model.rig.outputs(trial.kind) if n in trial.columns)
    out = {n: np.array(trial[n]) for n in outputs}
    for pieces in _chunks(range(0, max(len(trial) - ahead, 1), stride)):
        short = [masked(trial.first(s + ahead + stride), outputs, s + 1) for s in pieces]
        problem = LikelihoodProblem(model, short, doubt, (), starts=[trial] * len(short))
        run = problem.foretold(model.parameters())
        for s, foretold in zip(pieces, run, strict=True):
            rows = slice(s + ahead if s else 1, min(s + ahead + stride, len(trial)))
            for n in outputs:
                out[n][rows] = foretold[n][rows]
    return out


def _chunks(starts: range) -> Iterator[range]:
    for k in range(0, len(starts), AT_ONCE):
        yield starts[k : k + AT_ONCE]


def falls(model: Model, trials: Sequence[Trial]) -> bool:
    """True if a free simulation enlarges an error of its beginning by more than `GROWTH`: the rig falls by itself."""
    unknowns = tuple(dict.fromkeys(n for t in trials for n in model.rig.unknowns(t.kind)))
    if not unknowns:
        return False
    simulator = Simulator(model, trials, unknowns)
    with np.errstate(all="ignore"):
        run = simulator.run(model.parameters(), simulator.start(model.parameters()))
        largest = max(float(np.abs(one.sensitivities[:, 0, 0]).max()) for one in run)
    return not largest < GROWTH
