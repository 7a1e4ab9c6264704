"""A few long trials, each cut into parts, so that some parts can be held out and predicted by fits to the others."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from fes_pin.data.stuck import piece
from fes_pin.data.trial import Trial
from fes_pin.infer.levels import HORIZON_S
from fes_pin.models.compile.layout import WIDTH
from fes_pin.models.rigs.base import Rig

SHORTEST_S = 10.0 * HORIZON_S
"""Least length of a part, s: an error over the horizon is judged on as much."""


def in_parts(rig: Rig, trials: Sequence[Trial]) -> list[Trial]:
    """Return the trials, cut into parts of equal length if there are fewer than half as many as run in one batch.

    Each part begins at a state of its own, which is estimated from its first samples. Trials of a rig that begins at
    rest are not cut.
    """
    most = WIDTH // max(len(trials), 1)
    return [part for trial in trials for part in _cut(trial, most if rig.unknowns(trial.kind) else 1)]


def _cut(trial: Trial, most: int) -> list[Trial]:
    count = min(most, int(trial.duration / SHORTEST_S))
    if count < 2:
        return [trial]
    ends = np.linspace(0, len(trial), count + 1).round().astype(int)
    return [piece(trial, slice(int(a), int(b)), k) for k, (a, b) in enumerate(pairwise(ends))]
