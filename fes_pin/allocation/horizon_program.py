"""The horizon's quadratic program: solved by PIQP over its stages, then made exact from the limits that hold.

    min 1/2 |t|^2 + price/2 u^2 + change/2 |u_k - u_(k-1)|^2 + f'u,   t_k = keep t_(k-1) + (1 - keep) V u_k

within limits of u and of its changes. PIQP is a proximal interior-point method with a factorization for such stages
(Schwan, Jiang, Kuhn and Jones 2023, IEEE Conf. Decis. Control 1088-1093). Steps run slow, channels fast: u[k, i].
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import piqp
from scipy.sparse import csc_matrix

from fes_pin.allocation.active_limits import Limits, make_exact
from fes_pin.allocation.bounded import solve_by
from fes_pin.data.errors import InputError

RANK = 1e-14
"""Directions of torque in which channels make less than this, of the strongest squared, are left out."""
NO_ROOM = 1e-10
"""Limits nearer than this hold a step where it is; the interior method sees them this far apart."""
PRECISION = 1e-10
"""Residuals and gap at which the interior iterations end, of slopes that are larger than 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Plan (steps, n), multipliers (2 steps - 1, n) of limits and rates, iterations, and guesses at what is active.

    `rounds` is 0 where no guess settled: then the plan is the solver's, near the optimum but not exact.
    """

    u: np.ndarray
    y: np.ndarray
    iterations: int
    rounds: int


class HorizonProgram:
    """Minimise the cost of a horizon under limits and rates; threads take turns.

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
    like
        A program that differs in strength alone, if there is one: what does not depend on it is taken over.
    """

    def __init__(
        self,
        strength: np.ndarray,
        price: np.ndarray,
        change: float,
        keep: float,
        steps: int,
        tied: bool,
        like: HorizonProgram | None = None,
    ) -> None:
        values, vectors = np.linalg.eigh(strength @ strength.T)
        V = vectors[:, values > RANK * max(values[-1], 1e-300)].T @ strength
        self.n, self.steps, self.tied = strength.shape[1], steps, tied
        later = np.subtract.outer(np.arange(steps), np.arange(steps))
        self.response = np.where(later >= 0, (1.0 - keep) * keep ** np.maximum(later, 0), 0.0)
        step = np.eye(steps) - np.eye(steps, k=-1)
        over_time, changes = self.response.T @ self.response, change * step.T @ step
        self.curvature = np.kron(over_time, V.T @ V) + np.kron(changes, np.eye(self.n))  # of u alone
        self.curvature[np.diag_indices(steps * self.n)] += np.tile(price, steps)
        self._stages(V, price, changes, keep, like)
        self._lock = threading.Lock()
        self._solver: piqp.SparseSolver | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name not in ("_lock", "_solver")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _lock=threading.Lock(), _solver=None)

    def _stages(
        self, V: np.ndarray, price: np.ndarray, changes: np.ndarray, keep: float, like: HorizonProgram | None
    ) -> None:
        """The program over u and t, stage by stage: sparse, as solvers for sparse matrices want it."""
        (rank, n), steps = V.shape, self.steps
        width, channels, torques = n + rank, np.arange(n), np.arange(rank)
        self.size = width * steps
        A = np.zeros((steps, rank, steps, width))
        A[:, torques, :, n + torques] = np.eye(steps) - keep * np.eye(steps, k=-1)
        A[np.arange(steps), :, np.arange(steps), :n] = -(1.0 - keep) * V
        self.A = csc_matrix(A.reshape(-1, self.size))
        self.P: csc_matrix
        self.G: csc_matrix | None
        if like is not None and like.size == self.size:
            self.P, self.G = like.P, like.G
        else:
            P, G = np.zeros((steps, width, steps, width)), np.zeros((steps - 1, n, steps, width))
            P[:, channels, :, channels] = changes + np.multiply.outer(price, np.eye(steps))
            P[:, n + torques, :, n + torques] = np.eye(steps)
            G[:, channels, :, channels] = np.diff(np.eye(steps), axis=0)
            self.P = csc_matrix(P.reshape(-1, self.size))
            self.G = csc_matrix(G.reshape(-1, self.size)) if self.tied and steps > 1 else None
        self.where = (np.arange(steps)[:, None] * width + np.arange(n)).ravel()

    def _spread(self, values: np.ndarray, other: float) -> np.ndarray:
        """Values of u among those of u and t."""
        whole = np.full(self.size, other)
        whole[self.where] = values.ravel()
        return whole

    def solve(self, f: np.ndarray, low: np.ndarray, high: np.ndarray) -> Solution:
        """The plan for a linear term (steps, n) under limits and rates (2 steps - 1, n) each.

        Raises
        ------
        InputError
            Numbers beyond what double precision can tell apart.
        """
        near = self._interior(f, low, high)
        limits = Limits(low, high, self.steps, self.tied, NO_ROOM)
        exact = make_exact(self.curvature, f, limits, near.u, near.y)
        if exact is None:
            return replace(near, u=limits.met(near.u, near.y))
        u, y, rounds = exact
        return Solution(u, y, near.iterations, rounds)

    def _interior(self, f: np.ndarray, low: np.ndarray, high: np.ndarray) -> Solution:
        steps, large = self.steps, max(1.0, float(np.abs(f).max(initial=0.0)))
        narrow = np.where(high[:steps] - low[:steps] <= NO_ROOM, NO_ROOM, 0.0)
        least, most = (self._spread(a, s * np.inf) for a, s in ((low[:steps] - narrow, -1), (high[:steps] + narrow, 1)))
        c = self._spread(f, 0.0)
        with self._lock:
            if self._solver is None:
                self._solver = piqp.SparseSolver()
                self._solver.settings.kkt_solver = piqp.KKTSolver.sparse_multistage
                self._solver.settings.eps_rel = self._solver.settings.eps_duality_gap_rel = 0.0
                rates = (None, None) if self.G is None else (low[steps:].ravel(), high[steps:].ravel())
                self._solver.setup(self.P, c, self.A, np.zeros(self.A.shape[0]), self.G, *rates, least, most)
            else:
                self._solver.update(c=c, x_l=least, x_u=most)
            settings = self._solver.settings
            settings.eps_abs = settings.eps_duality_gap_abs = PRECISION * large
            self._solver.solve()
            found = self._solver.result
            x, box = found.x[self.where], (found.z_bu - found.z_bl)[self.where]
            ties = found.z_u - found.z_l if self.G is not None else np.zeros(0)
            iterations = int(found.info.iter)
        if not (np.isfinite(x).all() and np.isfinite(box).all()):
            raise InputError("no plan can be found: torques or moment arms of too different sizes")
        return Solution(x.reshape(steps, self.n), self._multipliers(box, ties), iterations, 0)

    def _multipliers(self, box: np.ndarray, ties: np.ndarray) -> np.ndarray:
        y = np.zeros((2 * self.steps - 1, self.n))
        y[: self.steps] = box.reshape(self.steps, self.n)
        if len(ties):
            y[self.steps :] = ties.reshape(self.steps - 1, self.n)
        return y

    def solve_by(self, solver: str, f: np.ndarray, low: np.ndarray, high: np.ndarray) -> Solution:
        """The same by a solver that qpsolvers knows: sparse over the stages for those that take it so, else dense.

        Raises
        ------
        InputError
            The solver finds no answer.
        """
        steps = self.steps
        rates = (low[steps:].ravel(), high[steps:].ravel())
        box = self._spread(low[:steps], -np.inf), self._spread(high[:steps], np.inf)
        x, ties, sides = solve_by(solver, self.P, self._spread(f, 0.0), self.G, *rates, *box, equal=self.A)
        found = np.zeros(len(self.where)) if sides is None else sides[self.where]
        y = self._multipliers(found, np.zeros(0) if ties is None else ties)
        u = x[self.where].reshape(steps, self.n)
        return Solution(Limits(low, high, steps, self.tied, NO_ROOM).met(u, y), y, 0, 0)
