"""Quadratic programs within limits of variables, and of rows of them, `min 1/2 r'Hr + f'r`, by DAQP, warm-started.

DAQP is a dual active-set method (Arnstrom, Bemporad and Axehill 2022, IEEE Trans. Autom. Control 67:4362-4369). It
solves in the variables `sqrt(H_ii) r_i`, whose curvatures are 1: a tolerance then means the same for every channel.
A limit with a multiplier holds exactly. The limits that hold determine the answer, which is computed from them alone
(`BoundedProgram.exact`), so that it does not depend on where the solver started.
"""

import threading
from typing import Any

import daqp
import numpy as np
import qpsolvers
from scipy.linalg import lu_factor, lu_solve
from scipy.sparse import csc_matrix

from fes_pin.data.errors import InputError

TOLERANCE = 1e-13
"""Violation of a limit that DAQP lets pass: 450 units of rounding of numbers about 1."""
PRECISE = 1e-14
"""Residual, of `lone_steps`, up to which an answer is taken as it is: 50 units of rounding."""

UPPER, LOWER = 1, 3
"""Flag of DAQP for an active limit."""


def lone_steps(
    slope: np.ndarray, r: np.ndarray, lower: np.ndarray, upper: np.ndarray, curvature: np.ndarray
) -> np.ndarray:
    """Return the largest move of any channel alone within its limits, (...): 0 exactly at the optimum."""
    far = np.minimum(np.maximum(slope / -curvature, lower - r), upper - r)
    return np.maximum.reduce(np.abs(far), -1)


class BoundedProgram:
    """A program within limits that starts where its last answer was; threads take turns.

    Limits, (n + k,), are those of the variables, then those of the rows. Multipliers, (n + k,), are positive for upper
    limits and negative for lower ones.

    Parameters
    ----------
    H
        (n, n), symmetric positive definite.
    rows
        (k, n), whose products with the variables are limited, too; none by default.
    like
        A program of the same size that was solved before, whose limits that hold are where this one begins.
    """

    def __init__(self, H: np.ndarray, rows: np.ndarray | None = None, like: "BoundedProgram | None" = None) -> None:
        self.given, self.root = (H, rows), np.sqrt(H.diagonal())
        self.unit = H / np.outer(self.root, self.root)
        self.rows = np.zeros((0, len(H))) if rows is None else rows / self.root
        self.size = np.append(self.root, np.ones(len(self.rows)))
        self._lock, self._model = threading.Lock(), daqp.Model()
        self._model.settings = {**self._model.settings, "primal_tol": TOLERANCE}
        self.last: np.ndarray = np.zeros(len(self.size)) if like is None else like.last
        active = np.where(self.last > 0.0, UPPER, np.where(self.last < 0.0, LOWER, 0)).astype(np.intc)
        limits = np.ones(len(self.size)), np.zeros(len(self.size))
        self._model.setup(self.unit.copy(), np.zeros(len(H)), self.rows.copy(), *limits, active)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self.given

    def solve(self, F: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """DAQP's answers (count, n) and multipliers for linear terms (count, n); NaN where it has none."""
        R, Y, n = np.empty(F.shape), np.empty((len(F), len(self.size))), len(self.root)
        with self._lock:
            self._model.update(bupper=upper * self.size, blower=lower * self.size)
            for k, f in enumerate(F / self.root):
                self._model.update(f=f)
                R[k], _, flag, info = self._model.solve()
                Y[k] = info["lam"] if flag == 1 else np.nan
            self.last = Y[-1] if len(Y) else self.last
        R, lower, upper = R / self.root, lower[:n], upper[:n]
        return held(np.minimum(np.maximum(R, lower), upper), Y[:, :n], lower, upper), Y * self.size

    def exact(
        self, f: np.ndarray, y: np.ndarray, lower: np.ndarray, upper: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The answer (n,) and its multipliers to rounding, from the limits that have a multiplier.

        Raises
        ------
        InputError
            There is none: the program holds numbers beyond what double precision can tell apart.
        """
        n, limit = len(f), np.where(y > 0.0, upper, lower) * self.size
        free, tied = y[:n] == 0.0, y[n:] != 0.0
        ties, x, z = self.rows[tied], np.where(free, 0.0, limit[:n]), np.zeros(int(tied.sum()))
        slope = self.unit @ x + f / self.root
        if free.any():
            corner = np.zeros((len(z), len(z)))
            factors = lu_factor(np.block([[self.unit[np.ix_(free, free)], ties[:, free].T], [ties[:, free], corner]]))
            for _ in range(2):  # the second time refines
                step = lu_solve(factors, np.append(slope[free], ties @ x - limit[n:][tied]))
                x[free], z = x[free] - step[: free.sum()], z - step[free.sum() :]
                slope = self.unit @ x + f / self.root + z @ ties
        if not (np.isfinite(x).all() and np.isfinite(y).all()):
            raise InputError("no solver finds the allocation: torques or moment arms of too different sizes")
        multipliers = np.append(np.where(free, 0.0, -slope * self.root), np.zeros(len(y) - n))
        multipliers[n:][tied] = z
        lower, upper = lower[:n], upper[:n]
        return held(np.clip(x / self.root, lower, upper), y[:n], lower, upper), multipliers


def held(r: np.ndarray, multipliers: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Answers (..., n), exactly at the limits that have a multiplier."""
    return np.where(multipliers > 0.0, upper, np.where(multipliers < 0.0, lower, r))


def solve_once(H: np.ndarray, f: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """The answer (n,) from a cold start, exact.

    Raises
    ------
    InputError
        See `BoundedProgram.exact`.
    """
    program = BoundedProgram(H)
    (y,) = program.solve(f[None], lower, upper)[1]
    return program.exact(f, y, lower, upper)[0]


def known_solver(solver: Any, has: str) -> str:
    """The name of a solver, `daqp` or one that qpsolvers knows.

    Raises
    ------
    InputError
        It is neither; `has` says what wants a solver.
    """
    if solver != "daqp" and solver not in qpsolvers.available_solvers:
        known = ", ".join(dict.fromkeys(["daqp", *qpsolvers.available_solvers]))
        raise InputError(f"solver {solver!r:.40} is not installed; for {has} there are {known}")
    return str(solver)


def solve_by(
    solver: str, H: np.ndarray, f: np.ndarray, lower: np.ndarray, upper: np.ndarray, rows: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The answer (n,) through qpsolvers, and the multipliers, 0 where the solver has none; limits as `BoundedProgram`.

    Raises
    ------
    InputError
        The solver finds no answer.
    """
    matrix = csc_matrix if solver in qpsolvers.sparse_solvers else np.asarray
    n, G, h = len(f), None, None
    if rows is not None:
        G, h = matrix(np.vstack([rows, -rows])), np.append(upper[n:], -lower[n:])
    quiet: dict[str, Any] = {"raise_error": False} if solver == "osqp" else {}  # it warns of a default that will change
    problem = qpsolvers.Problem(matrix(H), f, G, h, None, None, lower[:n], upper[:n])
    found = qpsolvers.solve_problem(problem, solver=solver, **quiet)
    if found.x is None or not np.isfinite(found.x).all():
        raise InputError(f"solver {solver!r} found no answer")
    box = np.zeros(n) if found.z_box is None else found.z_box
    ties = np.zeros(len(lower) - n) if found.z is None or rows is None else np.subtract(*np.split(found.z, 2))
    return found.x, np.append(box, ties)
