"""Proof of optimality that knows nothing of the solver: recomputed from moment arms, torque and limits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fes_pin.allocate.native import Native, Reals, address


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
        """Greatest of primal, dual and complementarity."""
        return max(self.primal, self.dual, self.complementarity)

    def is_optimal(self, tolerance: float = 1e-9) -> bool:
        """Whether no residual exceeds the tolerance."""
        return self.residual <= tolerance


def slopes(matrix, weights, scale, error, prices, r, keep, previous, cubes=False) -> np.ndarray:
    """Gradient of the cost over recruitment: (..., n). `error` = achieved - wanted, (..., joints)."""
    gradient = (error * weights) @ matrix / scale + (prices * r * r if cubes else prices * r)
    return gradient + keep * (r - previous) if keep else gradient


def residuals(gradient, r, lower, upper):
    """Primal, dual, complementarity and gap per sample, over the last axis."""
    below, above = r - lower, upper - r
    largest = np.maximum.reduce
    primal = largest(np.maximum(-below, -above), -1)
    dual = largest(np.abs(np.minimum(np.maximum(-gradient, -below), above)), -1)
    products = np.maximum(gradient * below, -gradient * above)
    return np.maximum(primal, 0.0), dual, largest(products, -1), np.add.reduce(products, -1)


def certify(
    joints: int,
    n: int,
    matrix: Reals,
    weights: Reals,
    prices: Reals,
    scale: float,
    keep: float,
    cubes: int,
    previous: Reals,
    wanted: Reals,
    r: Reals,
    lower: Reals,
    upper: Reals,
    achieved: Reals,
    gradient: Reals,
    out: Reals,
):
    """`slopes` and `residuals` of one sample in one pass; `out` gets primal, dual, complementarity, gap and cost."""
    cost = 0.0
    for i in range(n):
        change = r[i] - previous[i]
        effort = prices[i] * r[i] * r[i]
        gradient[i] = (effort if cubes > 0 else prices[i] * r[i]) + keep * change
        cost += (effort * r[i] / 3.0 if cubes > 0 else 0.5 * effort) + 0.5 * keep * change * change
    for j in range(joints):
        sum_ = 0.0
        for i in range(n):
            sum_ += matrix[j * n + i] * r[i]
        achieved[j] = sum_
        error = sum_ - wanted[j]
        cost += 0.5 * weights[j] * error * error / scale
        slope = weights[j] * error / scale
        for i in range(n):
            gradient[i] += slope * matrix[j * n + i]
    for i in range(5):
        out[i] = 0.0
    for i in range(n):
        below = r[i] - lower[i]
        above = upper[i] - r[i]
        g = gradient[i]
        violation = -below if below < above else -above
        step = -g if -g > -below else -below
        step = step if step < above else above
        product = g * below if g > 0.0 else -g * above
        out[0] = violation if violation > out[0] else out[0]
        out[1] = abs(step) if abs(step) > out[1] else out[1]
        out[2] = product if product > out[2] else out[2]
        out[3] += product
    out[4] = cost
    return 0


@lru_cache(maxsize=1)
def compiled() -> Native:
    """`certify` as machine code."""
    return Native(certify)


class Certifier:
    """Certificates of one program, one sample at a time.

    Parameters
    ----------
    matrix, weights, prices
        (joints, n) N m, (joints,), (n,).
    scale, keep
        (N m)^2, and the price of change.
    cubes
        Whether effort is `prices r^3 / 3` instead of `prices r^2 / 2`.
    """

    def __init__(self, matrix, weights, prices, scale: float, keep: float, cubes: bool = False) -> None:
        joints, n = matrix.shape
        self.fixed = [np.array(a, dtype=float, order="C") for a in (matrix, weights, prices)]
        self.given = [np.zeros(k) for k in (n, joints, n, n, n)]
        self.achieved, self.gradient, self.out = np.zeros(joints), np.zeros(n), np.zeros(5)
        self.scale, self.call = scale, compiled()["certify"]
        found = [address(a) for a in (*self.given, self.achieved, self.gradient, self.out)]
        self.arguments = (joints, n, *(address(a) for a in self.fixed), scale, keep, int(cubes), *found)

    def __call__(self, *given: np.ndarray) -> tuple[Certificate, np.ndarray, np.ndarray]:
        """Certificate, achieved torque and gradient for previous, wanted, r, lower, upper."""
        for array, values in zip(self.given, given, strict=True):
            array[:] = values
        self.call(*self.arguments)
        primal, dual, complementarity, gap, cost = self.out.tolist()
        proof = Certificate(primal, dual, complementarity, gap, cost, self.scale)
        return proof, self.achieved.copy(), self.gradient.copy()
