"""The horizon's quadratic program with its arrays, ready for any linear term and limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fes_pin.allocate.interior import compiled
from fes_pin.allocate.native import address
from fes_pin.data.errors import InputError

RANK = 1e-14
"""Directions of torque in which channels make less than this, of the strongest squared, are left out."""
NO_ROOM, WALL = 1e-10, 1e30
"""Limits nearer than this hold a step where it is, by a spring of this stiffness."""
STAGES = ((1e-9, 3), (1e-12, 10))
"""Residual at which the interior iterations end, and guesses at what is active that follow; then once more. Of slopes
that are larger than 1: torques far beyond what the channels make."""
ITERATIONS = 60
STIFF, SLACK = 1e4, 1e-11
"""Penalty of the method of multipliers; violations and wrong multipliers up to this are rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Plan (steps, n), multipliers (2 steps - 1, n) of limits and rates, iterations, and guesses at what is active.

    `rounds` is 0 where no guess settled: then the plan is the interior method's, near the optimum but not exact.
    """

    u: np.ndarray
    y: np.ndarray
    iterations: int
    rounds: int


class HorizonProgram:
    """Minimise the cost of a horizon (see `fes_pin.allocate.chains`) under limits and rates.

    Parameters
    ----------
    strength
        (m, n), torque of the channels over the root of the cost's scale.
    price
        (n,), of effort.
    change, keep
        Price of change; what a lag keeps per step.
    steps
        Length.
    tied
        Whether changes are limited.
    """

    def __init__(self, strength: np.ndarray, price, change: float, keep: float, steps: int, tied: bool) -> None:
        values, vectors = np.linalg.eigh(strength @ strength.T)
        kept = vectors[:, values > RANK * max(values[-1], 1e-300)]
        self.V = np.ascontiguousarray(kept.T @ strength)
        self.VT = np.ascontiguousarray(self.V.T)
        self.r, self.n = r, n = self.V.shape
        self.steps, self.rows = steps, 2 * steps - 1 if tied else steps
        self.price = np.array(price, dtype=float)
        size, rows, width = n * steps, n * (2 * steps - 1), max(r * steps, 1)
        shapes = (size, rows, size, size, steps * size, n * width, width * width, width, max(n, 4 * width), width, size)
        system = [np.zeros(k) for k in shapes]  # held, springs, ratio, inverse, Q, W, K, p, c, t, work
        self.held, self.system = system[0], system
        self.f, self.low, self.high = np.zeros(size), np.zeros(rows), np.zeros(rows)
        self.u, self.y, self.guess = np.zeros(size), np.zeros(rows), np.zeros(rows)
        self.below, self.above, self.z = np.ones(rows), np.ones(rows), np.zeros(2 * rows)
        g, b, d = np.zeros(size), np.zeros(size), np.zeros(rows)
        self.scratch = g, b, d
        fixed = (self.V, self.VT, self.price, *system, self.f, self.low, self.high)
        self.head = (n, r, steps, self.rows, keep, change, *(address(a) for a in fixed))
        self.tail = tuple(address(a) for a in self.scratch)
        self.native = compiled()

    def solve(self, f: np.ndarray, low: np.ndarray, high: np.ndarray) -> Solution:
        """The plan for a linear term (steps, n) under limits and rates (2 steps - 1, n) each.

        Raises
        ------
        InputError
            Numbers beyond what double precision can tell apart.
        """
        self.f[:], self.low[:], self.high[:] = f.ravel(), low.ravel(), high.ravel()
        size, rows = len(self.u), self.rows * self.n
        self.held[:] = np.where(self.high[:size] - self.low[:size] <= NO_ROOM, WALL, 0.0)
        places = [address(a) for a in (self.low, self.high, self.held, self.u)]
        self.native["centre"](self.n, self.steps, self.rows, *places)
        iterations, begun, large = 0, 0, max(1.0, float(np.abs(self.f).max(initial=0.0)))
        for tolerance, rounds in STAGES:
            inside = [address(a) for a in (self.u, self.below, self.above, self.z, self.y)]
            limit = ITERATIONS - iterations
            iterations += self.native["interior"](*self.head, *inside, *self.tail, limit, tolerance * large, begun)
            begun = 1
            lower, upper = self.z[:rows] > self.below[:rows], self.z[rows : 2 * rows] > self.above[:rows]
            self.guess[:rows] = np.subtract(upper, lower, dtype=float)
            self.guess[:size][self.held > 0.0] = 0.0
            near, multipliers = self.u.copy(), self.y.copy()
            try_ = [address(a) for a in (self.u, self.guess, self.y)]
            settled = self.native["finish"](*self.head, *try_, *self.tail, rounds, STIFF, SLACK, large)
            if settled:
                break
            self.u[:], self.y[:] = near, multipliers
        if not settled:
            self.u[:] = np.where(lower[:size], self.low[:size], np.where(upper[:size], self.high[:size], self.u))
        if not (np.isfinite(self.u).all() and np.isfinite(self.y).all()):
            raise InputError("no plan can be found: torques or moment arms of too different sizes")
        self.y[rows:] = 0.0
        shape = self.steps, self.n
        return Solution(self.u.reshape(shape).copy(), self.y.reshape(-1, self.n).copy(), iterations, settled)
