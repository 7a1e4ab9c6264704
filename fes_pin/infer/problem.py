"""A fit as a problem of nonlinear least squares: whitened residuals, their derivatives, and the normal equations."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

Unknowns = list[dict[str, float]]
"""For each trial, the values by name of its own unknowns."""
SINGULAR = 1e-12
"""Share of an unknown's own information that is added to it, so that two confounded unknowns do not stop a fit."""
STEEPEST = 1e120
"""Sensitivities above this, in deviations of the noise per unit, count as infinite, as their squares overflow."""


@dataclass(frozen=True)
class Linearized:
    """One trial near a parameter value: whitened residual and sensitivities.

    Rows are in the order of time, with the channels of a sample next to each other. A piece of the rows is a piece of
    time.

    Attributes
    ----------
    residual
        Shape (m,).
    jacobian
        Shape (m, parameters): derivative of the prediction, which is minus that of the residual.
    local
        Shape (m, unknowns of the trial).
    log_determinant
        Sum of the logarithms of the variances that whiten the residuals; 0 where these are given.
    """

    residual: np.ndarray
    jacobian: np.ndarray
    local: np.ndarray
    log_determinant: float = 0.0


class Problem(Protocol):
    """A problem of least squares: a model of trials with free parameters within limits.

    Attributes
    ----------
    free
        Names of the free parameters.
    limits
        Lower and upper bound of each, by name.
    unknown_names
        Names of each trial's own unknowns, which are eliminated.
    """

    free: tuple[str, ...]
    limits: dict[str, tuple[float, float]]
    unknown_names: tuple[str, ...]

    @property
    def products(self) -> Sequence[tuple[int, int]]:
        """Places in `free` of pairs of parameters that enter the model as a product."""
        return ()

    @property
    def batch(self) -> int:
        """Number of points that `costs` evaluates in one run."""
        return 1

    @property
    def is_final(self) -> bool:
        """False where derivatives are approximate: exact ones then lower the cost further at the end of a descent.

        These are the derivatives of a `NoisyProblem`.
        """
        return True

    def noise_step(self, values: Mapping[str, float], unknowns: Unknowns) -> float:
        """Improve the noise in place, parameters held; return by how much the cost falls: 0 of known noise."""
        return 0.0

    def start_unknowns(self) -> Unknowns:
        """Return start values of the unknowns of each trial."""

    def linearize(self, values: Mapping[str, float], unknowns: Unknowns) -> list[Linearized]:
        """Return whitened residuals and sensitivities of every trial at values of all parameters."""

    def costs(self, points: Sequence[tuple[Mapping[str, float], Unknowns]]) -> list[float]:
        """Return a lower bound of the cost at several points: the cost itself where it needs no sensitivities."""
        return [0.0] * len(points)


def completed(start: Unknowns, known: Unknowns | None) -> Unknowns:
    """Return start values of unknowns, with the known values from another model of the same trials."""
    if known is None:
        return start
    both = zip(start, known, strict=True)
    return [{n: values.get(n, value) for n, value in one.items()} for one, values in both]


@dataclass(frozen=True)
class NormalEquations:
    """The Gauss-Newton system with the unknowns of each trial eliminated.

    Attributes
    ----------
    sse
        Sum of squared whitened residuals.
    gradient, hessian
        Gradient and Hessian of half of it, shape (parameters,) and (parameters, parameters), after elimination.
    local_gain
        Predicted fall of the cost by steps of the trials' unknowns alone.
    """

    sse: float
    gradient: np.ndarray
    hessian: np.ndarray
    local_gain: float
    eliminated: tuple[tuple[np.ndarray, np.ndarray], ...]

    def local_steps(self, step: np.ndarray) -> list[np.ndarray]:
        """Return the steps of each trial's unknowns for a step of the parameters."""
        return [constant - slope @ step for constant, slope in self.eliminated]


@np.errstate(all="ignore")
def normal_equations(parts: Sequence[Linearized], damping: float = 0.0) -> NormalEquations:
    """Return the sum over trials, each trial's unknowns eliminated by its Schur complement with Marquardt's damping.

    For a model that diverges the sums are not finite; `whitened_sse` is infinite there.
    """
    size = parts[0].jacobian.shape[1]
    sse, gradient, hessian, local_gain = 0.0, np.zeros(size), np.zeros((size, size)), 0.0
    eliminated = []
    for part in parts:
        r, j, local = part.residual, part.jacobian, part.local
        sse += float(r @ r)
        g, h = j.T @ r, j.T @ j
        if local.shape[1]:
            own = local.T @ local
            if not np.isfinite(own).all():
                return NormalEquations(math.inf, np.zeros(size), np.zeros((size, size)), 0.0, ())
            solved = _solved(own, np.column_stack([local.T @ r, local.T @ j]), damping)
            constant, slope = solved[:, 0], solved[:, 1:]
            g, h = g - j.T @ (local @ constant), h - j.T @ (local @ slope)
            eliminated.append((constant, slope))
            local_gain += float(r @ (local @ constant))
        gradient += g
        hessian += h
    return NormalEquations(sse, gradient, hessian, local_gain, tuple(eliminated))


def _solved(own: np.ndarray, right: np.ndarray, damping: float) -> np.ndarray:
    """Return the solution of a trial's own system, damped and scaled; an unidentified unknown does not move."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(own), 1e-150))
    scaled = own * np.outer(scale, scale) + (damping + SINGULAR) * np.eye(len(own))
    return np.asarray(scale[:, None] * np.linalg.solve(scaled, scale[:, None] * right))


def whitened_sse(parts: Sequence[Linearized]) -> float:
    """Return the sum of squared whitened residuals and log-determinants; infinite where a prediction diverges."""
    with np.errstate(over="ignore", invalid="ignore"):
        total = float(sum(p.residual @ p.residual + p.log_determinant for p in parts))
    tame = all(float(np.abs(x).max(initial=0.0)) < STEEPEST for p in parts for x in (p.jacobian, p.local))
    return total if math.isfinite(total) and tame else math.inf
