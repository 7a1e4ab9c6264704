"""Quadratic programs with bounds only, `min 1/2 r'Hr + f'r, lower <= r <= upper`, by DAQP, warm-started.

DAQP is a dual active-set method (Arnstrom, Bemporad and Axehill 2022, IEEE Trans. Autom. Control 67:4362-4369). A
limit with a multiplier holds exactly.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import daqp
import numpy as np
import qpsolvers
from scipy.sparse import csc_matrix, issparse, vstack

from fes_pin.allocation.problem import within_rate
from fes_pin.data.errors import InputError

TOLERANCE = 1e-11
"""Violation of a bound that DAQP lets pass: a hundred times what rounding makes of numbers about 1."""
UNSOLVED = "no solver finds the allocation: torques or moment arms of too different sizes"


def held(r: np.ndarray, multipliers: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Answers (..., n) of DAQP, exactly at the limits that have a multiplier: positive for upper ones."""
    inside = np.minimum(np.maximum(r, lower), upper)
    return np.where(multipliers > 0.0, upper, np.where(multipliers < 0.0, lower, inside))


def new_model(H: np.ndarray, f: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> daqp.Model:
    """A workspace of DAQP; it belongs to one thread at a time."""
    model = daqp.Model()
    model.settings = {**model.settings, "primal_tol": TOLERANCE}
    model.setup(H.copy(), f.copy(), np.zeros((0, len(f))), upper.copy(), lower.copy())
    return model


def solve_once(H: np.ndarray, f: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """The answer (n,) from a cold start.

    Raises
    ------
    InputError
        DAQP finds none: the program holds numbers beyond what double precision can tell apart.
    """
    r, _, flag, info = new_model(H, f, lower, upper).solve()
    if flag != 1:
        raise InputError(UNSOLVED)
    return held(r, info["lam"], lower, upper)


def refined(H: np.ndarray, f: np.ndarray, r: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """An answer after one step of Newton's method for what is free: its slope is 0 to rounding of the given H."""
    free = np.flatnonzero((r > lower) & (r < upper))
    better = r.copy()
    better[free] -= np.linalg.solve(H[np.ix_(free, free)], (H @ r + f)[free])
    return np.clip(better, lower, upper)


class BoundedProgram:
    """A bounded program that starts where its last answer was; threads take turns.

    Parameters
    ----------
    H
        (n, n), symmetric positive definite.
    """

    def __init__(self, H: np.ndarray) -> None:
        self.H = H
        n = len(H)
        self._lock, self._bounds = threading.Lock(), (np.zeros(n), np.ones(n))
        self._model = new_model(H, np.zeros(n), *self._bounds)

    def solve(self, f: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """The answer (n,) for a linear term (n,).

        Raises
        ------
        InputError
            See `solve_once`.
        """
        with self._lock:
            if lower is self._bounds[0] and upper is self._bounds[1]:
                self._model.update(f=f)
            else:
                self._model.update(f=f, bupper=upper.copy(), blower=lower.copy())
                self._bounds = lower, upper
            r, _, flag, info = self._model.solve()
        if flag != 1:
            return solve_once(self.H, f, lower, upper)
        return held(r, info["lam"], lower, upper)


def solve_sequence(
    H: Any,
    F: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    keep: float = 0.0,
    rate: float = np.inf,
    previous: np.ndarray | None = None,
    settle: Callable[[int, np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray] | None = None,
) -> np.ndarray:
    """Solutions (count, n) of samples in order, each warm-started from the last.

    Parameters
    ----------
    H, F
        (n, n) or (count, n, n), and (count, n).
    lower, upper
        (n,).
    keep, rate, previous
        Price of change (H holds its diagonal already) and its bound per sample, from `previous` (n,), by default 0.
    settle
        What to make of sample k's answer before the next one follows from it: of k, answer, the one before, limits.

    Raises
    ------
    InputError
        See `solve_once`.
    """
    count, n = F.shape
    R, multipliers = np.empty((count, n)), np.empty((count, n))
    each, carries = H.ndim == 3, keep > 0.0 or rate < np.inf
    before = np.zeros(n) if previous is None else previous
    if not count:
        return R
    model, low, high = new_model(H[0] if each else H, F[0], lower, upper), lower, upper
    if not each and not carries:  # nothing but the linear term changes
        for k in range(count):
            model.update(f=F[k])
            R[k], _, flag, info = model.solve()
            multipliers[k] = info["lam"]
            if flag != 1:
                R[k], multipliers[k] = solve_once(H, F[k], lower, upper), 0.0
        return held(R, multipliers, lower, upper)
    for k in range(count):
        changed: dict[str, Any] = {"H": H[k]} if each else {}
        if rate < np.inf:
            low, high = within_rate(before, rate, lower, upper)
            changed |= {"bupper": high, "blower": low}
        f = F[k] - keep * before if keep else F[k]
        model.update(f=f, **changed)
        R[k], _, flag, info = model.solve()
        multipliers[k] = info["lam"]
        if flag != 1:
            R[k], multipliers[k] = solve_once(H[k] if each else H, f, low, high), 0.0
        if carries:
            r = held(R[k], multipliers[k], low, high)
            R[k] = before = r if settle is None else settle(k, r, before, low, high)
    return R if carries else held(R, multipliers, lower, upper)


def known_solver(solver: Any, own: str, has: str) -> str:
    """The name of a solver, `own` or one that qpsolvers knows.

    Raises
    ------
    InputError
        It is neither; `has` says what wants a solver.
    """
    if solver != own and solver not in qpsolvers.available_solvers:
        known = ", ".join(dict.fromkeys([own, *qpsolvers.available_solvers]))
        raise InputError(f"solver {solver!r:.40} is not installed; for {has} there are {known}")
    return str(solver)


def solve_by(
    solver: str,
    H: Any,
    f: np.ndarray,
    rows: Any = None,
    least: np.ndarray | None = None,
    most: np.ndarray | None = None,
    lower: np.ndarray | None = None,
    upper: np.ndarray | None = None,
    equal: Any = None,
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
    """`min 1/2 x'Hx + f'x, least <= rows x <= most, lower <= x <= upper, equal x = 0` through qpsolvers.

    Gives the answer, the multipliers of rows (upper minus lower) and of limits, where there are any. Matrices are
    handed on sparse to solvers that take them so, else dense.

    Raises
    ------
    InputError
        The solver finds no answer.
    """

    def matrix(a: Any) -> Any:
        if solver in qpsolvers.sparse_solvers:
            return csc_matrix(a)
        return a.toarray() if issparse(a) else a

    G, h, A, b = None, None, None, None
    if rows is not None and least is not None and most is not None:
        G, h = matrix(vstack([csc_matrix(rows), -csc_matrix(rows)])), np.concatenate([most, -least])
    if equal is not None:
        A, b = matrix(equal), np.zeros(equal.shape[0])
    quiet: dict[str, Any] = {"raise_error": False} if solver == "osqp" else {}  # it warns of a default that will change
    problem = qpsolvers.Problem(matrix(H), f, G, h, A, b, lower, upper)
    found = qpsolvers.solve_problem(problem, solver=solver, **quiet)
    if found.x is None or not np.isfinite(found.x).all():
        raise InputError(f"solver {solver!r} found no answer")
    ties = None if rows is None or found.z is None else np.subtract(*np.split(found.z, 2))
    return found.x, ties, found.z_box
