"""How long trials rest: stretches in which neither a reading nor an input changes beyond its noise.

The means of neighbouring blocks of samples differ at rest by the noise of a mean alone, and the readings of a block
scatter by the noise alone. A swing that is slow where it turns round passes one test of a block, and not the other, or
is too short to matter. Blocks are as long as it takes to tell motion from noise; where none is, nothing is said.
"""

import math
from collections.abc import Sequence

import numpy as np

from fes_pin.data.counts import count_of
from fes_pin.data.trial import Trial

SHORTEST = 16
"""Samples of a block, at least: the variance of fewer is known to less than a third."""
BLOCKS = 20
"""Blocks of a trial, at least: a rest is then known to a twentieth of the trial."""
SLOW = 0.1
"""Share of its usual largest step between blocks that a reading at rest may step by: a sine does so 6 % of the time."""
ERRORS = 3.0
"""Standard errors of a step that noise stays below, but for 3 in 1000."""
SCATTER = 3.0
"""Times its noise's variance that a block may have: of 16 samples of white noise one block in 10 000 has more."""
MATTERS = 0.5
"""Share of rest that is said: a motion is then known from fewer than half of the samples, with deviations more than
1.4 times as large as their number suggests."""


def rest_share(trials: Sequence[tuple[Trial, Sequence[str], Sequence[str]]]) -> float:
    """Share of the time, 0 to 1, in which trials rest.

    Parameters
    ----------
    trials
        Each with the names of its readings, and of its inputs.
    """
    rested = total = 0.0
    for trial, readings, inputs in trials:
        columns = [(trial[n], count_of(trial[n])) for n in readings] + [(trial[n], 0.0) for n in inputs]
        at_rest = np.logical_and.reduce([still(*one) for one in columns]) if columns else np.zeros(len(trial), bool)
        rested += trial.dt * float(at_rest.sum())
        total += trial.dt * len(trial)
    return rested / total if total else 0.0


def still(values: np.ndarray, count: float = 0.0) -> np.ndarray:
    """Samples, shape (n,), at which a column does not change beyond its noise; none where noise hides its motion.

    Parameters
    ----------
    values
        Shape (n,).
    count
        Of a reading in counts, the size of one: noise that is smaller goes to and fro by one.
    """
    if not np.ptp(values) > 0.0:
        return np.ones(len(values), dtype=bool)
    noise, size = max(_noise(values), 0.5 * count), SHORTEST
    while len(values) >= BLOCKS * size:
        blocks = values[: len(values) // size * size].reshape(-1, size)
        steps = np.abs(np.diff(blocks.mean(axis=1)))
        most = SLOW * float(np.quantile(steps, 0.95))
        if most >= ERRORS * noise * math.sqrt(2.0 / size):
            slow = steps <= most
            rests = np.append(slow, slow[-1]) & np.insert(slow, 0, slow[0])
            rests &= blocks.var(axis=1) <= SCATTER * noise**2 + 1e-18 * float(np.ptp(values)) ** 2
            return np.append(np.repeat(rests, size), np.full(len(values) % size, rests[-1]))
        size *= 2
    return np.zeros(len(values), dtype=bool)


def _noise(values: np.ndarray) -> float:
    """Standard deviation of white noise, from third differences: of a motion that sampling follows they are small."""
    return float(np.median(np.abs(np.diff(values, 3)))) / (0.6745 * math.sqrt(20.0)) if len(values) > 3 else 0.0
