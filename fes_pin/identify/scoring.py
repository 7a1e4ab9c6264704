"""What is random about a model and its readings, made more likely by Fisher scoring.

On logarithms, with r_k and V_k the innovations and their variances, r_i and V_i their derivatives by differences:

    g_i = sum r r_i / V + (1 - r^2 / V) V_i / (2 V),    I_ij = sum r_i r_j / V + V_i V_j / (2 V^2)

Of counts that stand for intervals the slopes s_k of half the cost of each reading say both: g = sum s, I = sum s s'
(Berndt, Hall, Hall and Hausman, Annals of Economic and Social Measurement 3, 1974).

Source: Kristensen, Madsen and Jorgensen, Parameter estimation in stochastic grey-box models, Automatica 40 (2004).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.identify.doubts import doubt_limits
from fes_pin.identify.problem import WORTH, Unknowns
from fes_pin.models.model import Model
from fes_pin.models.predictor import Doubt

LITTLE = 0.1
"""Fall of twice the log-likelihood with which turns end: a third of a standard deviation of one parameter."""
LOG_STEPS = (1e-3, 0.03)
"""Steps of the differences in logarithms: the second where the first promises what no step keeps, as where the cost is
rough: that of a play jumps where an estimate crosses its slack."""
LONGEST_MOVE = 1.5
"""Longest step of a logarithm: randomness changes by a factor of 4.5 at most before parameters move again."""


@dataclass(frozen=True)
class Told:
    """Innovations that were seen, all trials end to end, with their variances; their cost, of counts one by one too."""

    cost: float
    innovations: np.ndarray
    variances: np.ndarray
    costs: np.ndarray | None = None


class Foretelling(Protocol):
    """A problem that foretells its trials by any doubt."""

    model: Model
    trials: tuple[Trial, ...]
    doubt: Doubt

    @property
    def abreast(self) -> int:
        """How many doubts are tried in one run."""

    def told(self, values: Mapping[str, float], unknowns: Unknowns, doubts: Sequence[Doubt]) -> list[Told]:
        """Every trial as foretold by each of several doubts."""


def score_doubt(problem: Foretelling, values: Mapping[str, float], unknowns: Unknowns, steps: int = 2) -> float:
    """Improve what is random about a problem by Fisher scoring, in place; returns by how much that lowers the cost.

    Where no step promises `LITTLE` it stays.
    """
    limits = doubt_limits(problem.model, problem.trials, problem.doubt.lasts_s)
    names = tuple(problem.doubt.values())
    low, high = (np.log([limits[n][k] for n in names]) for k in (0, 1))
    z = np.clip(np.log([problem.doubt.values()[n] for n in names]), low, high)

    def at(z: np.ndarray) -> Doubt:
        return problem.doubt.with_values(dict(zip(names, (float(v) for v in np.exp(z)), strict=True)))

    def at_all(many: np.ndarray) -> list[Told]:
        return problem.told(values, unknowns, [at(z) for z in many])

    now, *moved = at_all(z + LOG_STEPS[0] * np.eye(1 + len(z), len(z), -1))
    damping, widths, begin = 1e-3, list(LOG_STEPS), now.cost
    while math.isfinite(now.cost):
        gradient, information = _scored(now, moved, widths[0])
        held = ((z <= low) & (gradient > 0)) | ((z >= high) & (gradient < 0))
        dampings = damping * 10.0 ** np.arange(1 + len(z))
        moves = [_damped_step(information, gradient, ~held, d) for d in dampings]
        if float(gradient @ moves[0]) < LITTLE:
            break
        found = _first_below(now, np.clip(z - np.array(moves), low, high), at_all, problem.abreast)
        if found is None:
            if 2.0 * float(gradient @ moves[0]) < WORTH or len(widths) == 1:
                break
            widths.pop(0)
        else:
            k, end, after = found
            gained, steps = now.cost - after.cost, steps - 1
            z, now, damping = end, after, max(0.3 * float(dampings[k]), 1e-6)
            if gained < LITTLE or not steps:
                break
        moved = at_all(z + widths[0] * np.eye(len(z)))
    problem.doubt = at(z)
    return begin - now.cost if math.isfinite(begin) else 0.0


def _first_below(
    now: Told, ends: np.ndarray, at_all: Callable[[np.ndarray], list[Told]], abreast: int
) -> tuple[int, np.ndarray, Told] | None:
    """The lowest of the first points in a run that has one below: its place, itself, and what it tells."""
    for k in range(0, len(ends), abreast):
        after = at_all(ends[k : k + abreast])
        best = int(np.argmin([one.cost for one in after]))
        if after[best].cost < now.cost:
            return k + best, ends[k + best], after[best]
    return None


def _scored(now: Told, moved: Sequence[Told], width: float) -> tuple[np.ndarray, np.ndarray]:
    """Gradient and expected information of half the cost, of logarithms, from differences; see the module."""
    if now.costs is not None:
        slopes = np.stack([0.5 * (m.costs - now.costs) / width for m in moved], axis=1)
        return slopes.sum(axis=0), slopes.T @ slopes
    r, v = now.innovations, now.variances
    dr = np.stack([(m.innovations - r) / width for m in moved], axis=1)
    dv = np.stack([(m.variances - v) / width for m in moved], axis=1) / v[:, None]
    gradient = (r / v) @ dr + 0.5 * (1.0 - r * r / v) @ dv
    return gradient, (dr / v[:, None]).T @ dr + 0.5 * dv.T @ dv


def _damped_step(information: np.ndarray, gradient: np.ndarray, free: np.ndarray, damping: float) -> np.ndarray:
    """A step of the logarithms, no longer than `LONGEST_MOVE`.

    Raises
    ------
    LinAlgError
        If the likelihood has no finite slope; LAPACK would print lines of its own beside.
    """
    step = np.zeros(len(gradient))
    if free.any():
        inner = information[np.ix_(free, free)]
        if not (np.isfinite(inner).all() and np.isfinite(gradient[free]).all()):
            raise np.linalg.LinAlgError("the likelihood has no finite slope by what is random")
        inner = inner + np.diag(damping * np.diag(inner) + 1e-9)
        step[free] = np.linalg.lstsq(inner, gradient[free], rcond=1e-12)[0]
    longest = float(np.abs(step).max(initial=0.0))
    return step * min(1.0, LONGEST_MOVE / max(longest, 1e-300))
