"""Proof of optimality that knows nothing of the solver: recomputed from moment arms, torque and limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fes_pin.allocation.problem import EPSILON, AllocationProblem


@dataclass(frozen=True, slots=True)
class Certificate:
    """How far an allocation is from optimal, in the program divided by its `scale` (N m)^2.

    Attributes
    ----------
    primal
        Greatest violation of a limit, as a recruitment.
    dual
        Greatest `|r - clip(r - gradient)|`: 0 exactly at an optimum.
    complementarity
        Greatest product of a multiplier and its limit's slack.
    gap
        Sum of these products: no allocation within the limits has a cost lower by more (the cost is convex).
    cost
        The cost reached, (torque error + effort) / scale.
    scale
        (N m)^2, the squared torque of the strongest channel.
    """

    primal: float
    dual: float
    complementarity: float
    gap: float
    cost: float
    scale: float

    @property
    def residual(self) -> float:
        """Greatest of primal, dual and complementarity; not a number where one of them is none."""
        parts = (self.primal, self.dual, self.complementarity)
        return math.nan if any(math.isnan(part) for part in parts) else max(parts)

    def is_optimal(self, tolerance: float = 1e-9) -> bool:
        """Whether no residual exceeds the tolerance, and the cost is a finite number."""
        return self.residual <= tolerance and math.isfinite(self.cost) and math.isfinite(self.gap)


def residuals(
    gradient: np.ndarray, r: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Primal, dual, complementarity and gap per sample, over the last axis."""
    below, above = r - lower, upper - r
    largest = np.maximum.reduce
    primal = largest(np.maximum(-below, -above), -1)
    dual = largest(np.abs(np.minimum(np.maximum(-gradient, -below), above)), -1)
    products = np.maximum(gradient * below, -gradient * above)
    return np.maximum(primal, 0.0), dual, largest(products, -1), np.add.reduce(products, -1)


class Certifier:
    """Certificates of a problem: slopes and costs from its definition alone.

    Lexicographic problems are certified for the torque error alone, which comes first.

    Parameters
    ----------
    problem
        Nothing else is read.
    """

    def __init__(self, problem: AllocationProblem) -> None:
        self.problem, self.first_only = problem, problem.lexicographic
        self.weighed = problem.weights / problem.scale
        self.prices = np.zeros(problem.n) if self.first_only else problem.prices
        self.change = 0.0 if self.first_only else problem.change
        self.turned = np.ascontiguousarray(problem.matrix.T)
        joints, n = problem.matrix.shape
        arms = np.abs(problem.matrix) * self.weighed[:, None]
        bulk = arms.T @ np.abs(problem.matrix).sum(1) + problem.prices + problem.change
        unit = (joints + n + 4) * EPSILON  # n products in a torque, as many sums over joints, prices and change
        self.unit, self.arms = unit * float(bulk.max()), unit * float(arms.sum(0).max())
        curvature = np.abs(problem.squares).max(0) + problem.prices + problem.change
        self.stiffness = n * curvature

    def rounding(self, wanted: np.ndarray) -> float:
        """Bound on the rounding error of the gradient anywhere within the limits.

        A sum of k products errs by k units of rounding of the sum of their sizes at most (Higham 2002, Accuracy and
        Stability of Numerical Algorithms, section 3.1).
        """
        return self.unit + self.arms * float(np.abs(wanted).max())

    def gradient(self, achieved: np.ndarray, wanted: np.ndarray, r: np.ndarray, previous: np.ndarray) -> np.ndarray:
        """Slope of the cost over recruitment, (..., n), at `achieved` (..., joints) N m."""
        slope = ((achieved - wanted) * self.weighed) @ self.problem.matrix
        if not self.first_only:
            slope += self.prices * r * r if self.problem.cubes else self.prices * r
            if self.change:
                slope += self.change * (r - previous)
        return slope

    def cost(self, achieved: np.ndarray, wanted: np.ndarray, r: np.ndarray, previous: np.ndarray) -> float:
        """Cost of one sample."""
        error = achieved - wanted
        cost = 0.5 * float((self.weighed * error) @ error)
        if not self.first_only:
            cost += float(self.prices @ r**3) / 3.0 if self.problem.cubes else 0.5 * float((self.prices * r) @ r)
            if self.change:
                cost += 0.5 * self.change * float((r - previous) @ (r - previous))
        return cost

    def __call__(
        self, previous: np.ndarray, wanted: np.ndarray, r: np.ndarray, lower: np.ndarray, upper: np.ndarray
    ) -> tuple[Certificate, np.ndarray, np.ndarray]:
        """Certificate, achieved torque and gradient of one sample."""
        achieved = r @ self.turned
        gradient = self.gradient(achieved, wanted, r, previous)
        primal, dual, complementarity, gap = residuals(gradient, r, lower, upper)
        cost = self.cost(achieved, wanted, r, previous)
        proof = Certificate(float(primal), float(dual), float(complementarity), float(gap), cost, self.problem.scale)
        return proof, achieved, gradient

    def residual(
        self, previous: np.ndarray, wanted: np.ndarray, r: np.ndarray, lower: np.ndarray, upper: np.ndarray
    ) -> np.ndarray:
        """Greatest residual per sample of arrays (..., n)."""
        gradient = self.gradient(r @ self.turned, wanted, r, previous)
        return np.maximum.reduce(residuals(gradient, r, lower, upper)[:3])

    def room(self, rounding: float) -> np.ndarray:
        """Recruitments (n,) whose effort the certificate cannot see: its slope is rounding."""
        squares = rounding / (self.problem.prices + self.problem.change)
        return np.maximum(squares, np.sqrt(rounding / self.problem.prices)) if self.problem.cubes else squares

    def at_limits(
        self,
        previous: np.ndarray,
        wanted: np.ndarray,
        r: np.ndarray,
        lower: np.ndarray,
        upper: np.ndarray,
        accuracy: float = 0.0,
    ) -> np.ndarray:
        """The same recruitments (n,), at their limits where the certificate cannot tell them from these.

        What is within the certificate's own rounding error of a limit is at the limit: off is off, not a pulse at
        threshold. First all at once whose effort is rounding, if the certificate holds without them; else those whose
        move changes no slope by more than rounding. `accuracy` is the residual at which an iteration ended, if one did.
        """
        slack = np.minimum(r - lower, upper - r)
        rounding = max(self.rounding(wanted), accuracy)
        near = (slack > 0.0) & (slack <= self.room(rounding))
        if not near.any():
            return r
        limit = np.where(r - lower <= upper - r, lower, upper)
        moved = np.where(near, limit, r)
        before, after = (float(self.residual(previous, wanted, x, lower, upper)) for x in (r, moved))
        if after <= max(before, rounding):
            return moved
        return np.where((slack > 0.0) & (slack * self.stiffness <= rounding), limit, r)
