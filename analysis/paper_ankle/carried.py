"""What the uncertainty of the passive antagonist, as `fp.fit_antagonist` finds it, does to the ratios k1, k2 and k3."""

from __future__ import annotations

import dataclasses

import numpy as np

from fes_pin.models.model import Model
from fes_pin.paper.antagonist import NAMES, Antagonist
from paper_ankle.ratios import RATIOS, Optimum, RatioProblem, least_error


def with_antagonist(model: Model, constants: dict[str, float]) -> Model:
    """The same ankle with another passive curve."""
    return Model(dataclasses.replace(model.rig, constants={**model.rig.constants, **constants}), model.effects)


def carried_covariance(problem: RatioProblem, optimum: Optimum, antagonist: Antagonist) -> np.ndarray:
    """What the uncertainty of F_ANT alone does to k1, k2 and k3: covariance of their logarithms, shape (3, 3).

    The ratios are found again with the curve one standard deviation off, up and down, along each principal axis.
    """
    values, vectors = np.linalg.eigh(antagonist.covariance)
    start = problem.model_at(optimum.x)
    covariance = np.zeros((len(RATIOS), len(RATIOS)))
    for size, axis in zip(np.sqrt(np.maximum(values, 0.0)), vectors.T, strict=True):
        ends = []
        for sign in (1.0, -1.0):
            moved = dict(zip(NAMES, (float(v) for v in antagonist.values + sign * size * axis), strict=True))
            moved_model = with_antagonist(problem.model, moved).with_parameters(start.parameters())
            # the start moves with the model; the gain that is known does not
            again = RatioProblem(moved_model, problem.trials, known_gain=problem.known["gain"])
            ends.append(least_error(again, starts=1).x)
        change = 0.5 * (ends[0] - ends[1])
        covariance += np.outer(change, change)
    return covariance
