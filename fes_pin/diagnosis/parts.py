"""A few long trials, each in parts: what a cause adds is then foretold for some by the others."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from fes_pin.data.stuck import piece
from fes_pin.data.trial import Trial
from fes_pin.infer.levels import HORIZON_S
from fes_pin.models.compile.layout import WIDTH
from fes_pin.models.rigs.base import Rig

SHORTEST_S = 10.0 * HORIZON_S
"""Length of a part at least: as much as an error over the horizon is judged on."""


def in_parts(rig: Rig, trials: Sequence[Trial]) -> list[Trial]:
    """The trials, cut into as many parts of one length as run side by side where they are half as many or fewer.

    Each part begins at a state of its own, which its first samples tell; where a rig begins at rest, none is cut.
    """
    most = WIDTH // max(len(trials), 1)
    return [part for trial in trials for part in _cut(trial, most if rig.unknowns(trial.kind) else 1)]


def _cut(trial: Trial, most: int) -> list[Trial]:
    count = min(most, int(trial.duration / SHORTEST_S))
    if count < 2:
        return [trial]
    ends = np.linspace(0, len(trial), count + 1).round().astype(int)
    return [piece(trial, slice(int(a), int(b)), k) for k, (a, b) in enumerate(pairwise(ends))]
