"""Linear programs with an account of their error: by how much rounding and the solver's tolerances can move a result.

The answer x of min c'x and its multipliers bound the true optimum from both sides: by weak duality from below, and from
above as far as x meets its constraints, each of whose violations moves the optimum by its multiplier, to first order.
Sums of n products are exact to n units of rounding of the sum of their sizes (N. Higham, Accuracy and Stability of
Numerical Algorithms, 2002, section 3.1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import optimize, sparse

FEASIBLE = 1e-7
"""Tolerance of HiGHS on constraints."""
_UNIT = float(np.finfo(float).eps)


WAYS = ({"method": "highs"}, {"method": "highs", "options": {"presolve": False}}, {"method": "highs-ipm"})
"""HiGHS as it chooses by itself, and what to try where it gives up on the numbers of a program."""


def linprog(*arguments, **options):
    """`scipy.optimize.linprog` by HiGHS; tried in another way where it ends without an answer (status 4)."""
    for way in WAYS:
        found = optimize.linprog(*arguments, **options, **way)
        if found.status != 4:
            break
    return found


@dataclass(frozen=True)
class LinearProgram:
    """min c'x with A_ub x <= b_ub, A_eq x = b_eq, lower <= x <= upper.

    Raises
    ------
    ValueError
        Shapes that do not fit (from the solver).
    """

    cost: np.ndarray
    A_ub: np.ndarray = field(repr=False)
    b_ub: np.ndarray = field(repr=False)
    A_eq: np.ndarray = field(repr=False)
    b_eq: np.ndarray = field(repr=False)
    lower: np.ndarray = field(repr=False)
    upper: np.ndarray = field(repr=False)

    def widened(self, cost: Sequence[float] | np.ndarray, A_ub: np.ndarray, A_eq: np.ndarray) -> LinearProgram:
        """The same with further variables, each 0 or more: their costs (v,), and their columns, (rows, v) each."""
        lower, upper = np.append(self.lower, np.zeros(len(cost))), np.append(self.upper, np.full(len(cost), np.inf))
        A_ub, A_eq = np.column_stack([self.A_ub, A_ub]), np.column_stack([self.A_eq, A_eq])
        return replace(self, cost=np.append(self.cost, cost), A_ub=A_ub, A_eq=A_eq, lower=lower, upper=upper)

    def towards(self, other: LinearProgram) -> LinearProgram:
        """The program whose last variable says how far from these limits to those of another, 1 there, an answer is."""
        return self.widened([-1.0], self.b_ub - other.b_ub, self.b_eq - other.b_eq)

    def solve(self) -> ProgramAnswer:
        """The answer by HiGHS."""
        if not len(self.cost):
            kept = np.all(self.b_ub >= -FEASIBLE) and np.all(np.abs(self.b_eq) <= FEASIBLE)
            return ProgramAnswer(np.zeros(0) if kept else None, 0.0)
        most, equal = (sparse.csr_array(rows) for rows in (self.A_ub, self.A_eq))
        bounds = np.column_stack([self.lower, self.upper])
        found = linprog(self.cost, most, self.b_ub, equal, self.b_eq, bounds)
        if found.status != 0:
            return ProgramAnswer(None, np.inf, unbounded=found.status == 3)
        return ProgramAnswer(found.x, self._error(found))

    def _error(self, found) -> float:
        x, z, y = found.x, np.minimum(found.ineqlin.marginals, 0.0), found.eqlin.marginals
        reduced = self.cost - self.A_ub.T @ z - self.A_eq.T @ y
        ends = np.where(reduced > 0.0, self.lower, self.upper)
        far = ~np.isfinite(ends)  # where a bound is infinite a multiplier is rounding: it acts over the answer's reach
        ends = np.where(far, x, ends)
        gap = abs(self.cost @ x - (self.b_ub @ z + self.b_eq @ y + reduced @ ends))
        over = np.maximum(self.A_ub @ x - self.b_ub, 0.0)
        missed = np.abs(self.A_eq @ x - self.b_eq)
        size = np.abs(x)
        terms = np.abs(z) @ (np.abs(self.A_ub) @ size + np.abs(self.b_ub)) + np.abs(self.cost) @ size
        terms += np.abs(y) @ (np.abs(self.A_eq) @ size + np.abs(self.b_eq))
        rounding = (len(x) + len(self.b_ub) + len(self.b_eq)) * _UNIT * terms
        return float(gap + np.abs(z) @ over + np.abs(y) @ missed + rounding)


@dataclass(frozen=True)
class ProgramAnswer:
    """Result of a linear program: x, or None where there is none, and the error of its cost."""

    x: np.ndarray | None
    error: float
    unbounded: bool = False

    @property
    def greatest(self) -> tuple[float, float]:
        """The last variable, of which the most was sought, and its error; infinite without end, else NaN without x."""
        if self.x is None:
            return (np.inf if self.unbounded else np.nan), 0.0
        return max(float(self.x[-1]), 0.0), self.error
