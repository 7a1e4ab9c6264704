"""A fit as a problem of nonlinear least squares: whitened residuals, their derivatives, and the normal equations."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

Unknowns = list[dict[str, float]]
"""Of each trial, the values by name of what is unknown about it alone."""
SINGULAR = 1e-12
"""Share of an unknown's own information added to it: two that the trial cannot tell apart do not stop a fit."""
STEEPEST = 1e120
"""Sensitivities beyond this, in deviations of the noise per unit, count as infinite: their squares would be."""


@dataclass(frozen=True)
class Linearized:
    """One trial near a parameter value: whitened residual and sensitivities, all channels end to end.

    Attributes
    ----------
    residual
        Shape (m,).
    jacobian
        Shape (m, parameters): derivative of the prediction, so the residual falls along it.
    local
        Shape (m, unknowns of the trial).
    log_determinant
        Sum of the logarithms of the variances that the residuals were whitened with; 0 where these are given.
    """

    residual: np.ndarray
    jacobian: np.ndarray
    local: np.ndarray
    log_determinant: float = 0.0


class Problem(Protocol):
    """What is fitted: a model of trials whose parameters move within limits.

    Attributes
    ----------
    free
        Names of the parameters that move.
    limits
        Lower and upper bound of each, by name.
    unknown_names
        Unknowns that each trial has of its own; they are eliminated.
    """

    free: tuple[str, ...]
    limits: dict[str, tuple[float, float]]
    unknown_names: tuple[str, ...]

    @property
    def products(self) -> Sequence[tuple[int, int]]:
        """Places in `free` of a parameter, and of another that it is multiplied with where it enters the model."""
        return ()

    @property
    def batch(self) -> int:
        """How many points `costs` evaluates in one run."""
        return 1

    @property
    def is_final(self) -> bool:
        """False where the derivatives are approximate, and others lead further from the end of a descent."""
        return True

    def start_unknowns(self) -> Unknowns:
        """The unknowns of each trial that a fit begins with."""

    def linearize(self, values: Mapping[str, float], unknowns: Unknowns) -> list[Linearized]:
        """Whitened residuals and sensitivities of every trial at values of all parameters."""

    def costs(self, points: Sequence[tuple[Mapping[str, float], Unknowns]]) -> list[float]:
        """A lower bound of the cost at several points: the cost itself where it needs no sensitivities."""
        return [0.0] * len(points)


def completed(start: Unknowns, known: Unknowns | None) -> Unknowns:
    """Unknowns that a fit begins with, at the values known of them from another model of the same trials."""
    if known is None:
        return start
    both = zip(start, known, strict=True)
    return [{n: values.get(n, value) for n, value in one.items()} for one, values in both]


@dataclass(frozen=True)
class NormalEquations:
    """Gauss-Newton system with the unknowns of each trial eliminated.

    Attributes
    ----------
    sse
        Sum of squared whitened residuals.
    gradient, hessian
        Of half of it, shape (parameters,) and (parameters, parameters), after elimination.
    local_gain
        Predicted fall of the cost by steps of the trials' unknowns alone.
    """

    sse: float
    gradient: np.ndarray
    hessian: np.ndarray
    local_gain: float
    eliminated: tuple[tuple[np.ndarray, np.ndarray], ...]

    def local_steps(self, step: np.ndarray) -> list[np.ndarray]:
        """Steps of each trial's unknowns that go with a step of the parameters."""
        return [constant - slope @ step for constant, slope in self.eliminated]


@np.errstate(all="ignore")
def normal_equations(parts: Sequence[Linearized], damping: float = 0.0) -> NormalEquations:
    """Sum the trials; each trial's unknowns are eliminated by its Schur complement, damped as Marquardt does.

    Of a model that runs away the sums are no numbers; `whitened_sse` is infinite there.
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
    """Solution of a trial's own system, damped and scaled; an unknown that is not felt stays where it is."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(own), 1e-150))
    scaled = own * np.outer(scale, scale) + (damping + SINGULAR) * np.eye(len(own))
    return np.asarray(scale[:, None] * np.linalg.solve(scaled, scale[:, None] * right))


def whitened_sse(parts: Sequence[Linearized]) -> float:
    """Sum of squared whitened residuals and log-determinants; infinite where a prediction or its slopes run away."""
    with np.errstate(over="ignore", invalid="ignore"):
        total = float(sum(p.residual @ p.residual + p.log_determinant for p in parts))
    tame = all(float(np.abs(x).max(initial=0.0)) < STEEPEST for p in parts for x in (p.jacobian, p.local))
    return total if math.isfinite(total) and tame else math.inf
