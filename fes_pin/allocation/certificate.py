"""Proof of optimality that knows nothing of the solver: recomputed from moment arms, torque and limits."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fes_pin.allocation.inputs import LARGEST_NM
from fes_pin.allocation.problem import EPSILON, AllocationProblem, Limits

Solve = Callable[[np.ndarray, np.ndarray], np.ndarray]
NOTHING = 1e-12
"""A recruitment nearer to a limit than this is at the limit; a pulse that recruits so little is none."""


@dataclass(frozen=True, slots=True)
class Certificate:
    """Distance of an allocation from the optimum, in the program divided by its `scale` (N m)^2.

    Attributes
    ----------
    primal
        Greatest violation of a limit, as a recruitment.
    dual
        Greatest `|r - clip(r - gradient / curvature)|`, the step that a channel alone would make: 0 exactly at an
        optimum. The curvature is the channel's own, so that prices of any size mean the same.
    complementarity
        Greatest product of a multiplier, over the same curvature, and its limit's slack.
    gap
        Sum of the products of multipliers and slacks: no allocation within the limits has a cost lower by more (the
        cost is convex).
    cost
        The cost reached, (torque error + effort) / scale.
    scale
        (N m)^2, the squared torque of the strongest channel.
    flattest
        Least part of a channel's curvature that is its price: a residual of as much may move a recruitment from 0 to 1.
    rounding
        Residual that double precision and `NOTHING` leave.
    """

    primal: float
    dual: float
    complementarity: float
    gap: float
    cost: float
    scale: float
    flattest: float = 1.0
    rounding: float = 0.0

    @property
    def residual(self) -> float:
        """Greatest of primal, dual and complementarity; not a number where one of them is none."""
        parts = (self.primal, self.dual, self.complementarity)
        return math.nan if math.isnan(sum(parts)) else max(parts)

    def is_optimal(self, tolerance: float = 1e-9) -> bool:
        """Whether no residual exceeds this part of `flattest`, or else rounding, and the cost is a finite number."""
        is_finite = math.isfinite(self.cost) and math.isfinite(self.gap)
        return is_finite and self.residual <= max(tolerance * self.flattest, self.rounding)


def residuals(
    gradient: np.ndarray, r: np.ndarray, lower: np.ndarray, upper: np.ndarray, curvature: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Primal, dual, complementarity and gap per sample, over the last axis."""
    below, above, step = lower - r, upper - r, gradient / -curvature
    largest = np.maximum.reduce
    primal = largest(np.maximum(below, -above), -1)
    dual = largest(np.abs(np.minimum(np.maximum(step, below), above)), -1)
    products = np.maximum(step * below, step * above)
    return np.maximum(primal, 0.0), dual, largest(products, -1), np.vecdot(products, curvature)


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
        prices = self.prices + self.change
        curvature = problem.squares.diagonal() + prices
        self.curvature = np.where(curvature > 0.0, curvature, 1.0)
        self.flattest = 1.0 if self.first_only else float((prices / self.curvature).min())
        arms = np.abs(problem.matrix) * self.weighed[:, None]
        unit = (joints + n + 4) * EPSILON  # n products in a torque, as many sums over joints, prices and change
        self.unit, self.arms = unit * (arms.T @ np.abs(problem.matrix).sum(1) + prices), unit * arms.sum(0)
        self.hidden = [float((part / self.curvature).max()) for part in (self.unit, self.arms)]
        self.paid = problem.prices + problem.change
        far = float(((self.unit + self.arms * LARGEST_NM) / self.paid).max())
        self.farthest = np.inf if problem.cubes else max(far, NOTHING)

    def rounding(self, wanted: np.ndarray) -> np.ndarray:
        """Bound on the rounding error of the gradient (n,) anywhere within the limits.

        A sum of k products errs by k units of rounding of the sum of their sizes at most (Higham 2002, Accuracy and
        Stability of Numerical Algorithms, section 3.1).
        """
        return self.unit + self.arms * float(np.abs(wanted).max(initial=0.0))

    def unseen(self, wanted: np.ndarray) -> float:
        """Residual up to which rounding of the gradient, or a recruitment that is nothing, hides the optimum."""
        return max(self.hidden[0] + self.hidden[1] * float(np.abs(wanted).max(initial=0.0)), NOTHING)

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
        self, previous: np.ndarray, wanted: np.ndarray, r: np.ndarray, limits: Limits
    ) -> tuple[Certificate, np.ndarray, np.ndarray]:
        """Certificate, achieved torque and gradient of one sample."""
        achieved = r @ self.turned
        gradient = self.gradient(achieved, wanted, r, previous)
        primal, dual, complementarity, gap = residuals(gradient, r, *limits, self.curvature)
        cost = self.cost(achieved, wanted, r, previous)
        parts = float(primal), float(dual), float(complementarity), float(gap)
        proof = Certificate(*parts, cost, self.problem.scale, self.flattest, self.unseen(wanted))
        return proof, achieved, gradient

    def residual(self, previous: np.ndarray, wanted: np.ndarray, r: np.ndarray, limits: Limits) -> np.ndarray:
        """Greatest residual per sample of arrays (..., n)."""
        gradient = self.gradient(r @ self.turned, wanted, r, previous)
        return np.maximum.reduce(residuals(gradient, r, *limits, self.curvature)[:3])

    def close(self, slack: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Which recruitments (..., n) are so near to a limit that the certificate cannot see it, or nothing."""
        near = (slack > 0.0) & (slack <= self.farthest)
        if not near.any():
            return near
        room = self.rounding(wanted) / self.paid
        if self.problem.cubes:
            room = np.maximum(room, np.sqrt(self.unseen(wanted) * self.curvature / self.problem.prices))
        return near & (slack <= np.maximum(room, NOTHING))

    def at_limits(
        self, previous: np.ndarray, wanted: np.ndarray, r: np.ndarray, limits: Limits, solve: Solve | None = None
    ) -> np.ndarray:
        """The same recruitments (n,), at their limits where the certificate cannot tell them from these.

        What is within the certificate's own rounding error of a limit is at the limit, if the certificate holds then;
        what is within `NOTHING` is in any case: off is off, not a pulse at threshold. What that does to the others is
        settled by `solve`, which gives the optimum between limits.
        """
        lower, upper = limits
        slack = np.minimum(r - lower, upper - r)
        near = self.close(slack, wanted)
        if not near.any():
            return r
        limit = np.where(r - lower <= upper - r, lower, upper)
        moved = np.where(near, limit, r)
        before, after = (float(self.residual(previous, wanted, x, limits)) for x in (r, moved))
        if after <= max(before, self.unseen(wanted)):
            return moved
        nothing = near & (slack <= NOTHING)
        if solve is None or not nothing.any():
            return np.where(nothing, limit, r)
        return solve(np.where(nothing, limit, lower), np.where(nothing, limit, upper))
