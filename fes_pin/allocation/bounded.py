"""Quadratic programs with bounds only, `min 1/2 r'Hr + f'r, lower <= r <= upper`, by DAQP, warm-started.

DAQP is a dual active-set method (Arnstrom, Bemporad and Axehill 2022, IEEE Trans. Autom. Control 67:4362-4369). It
solves in the variables `sqrt(H_ii) r_i`, whose curvatures are 1: a tolerance then means the same for every channel.
A limit with a multiplier holds exactly. An answer whose conditions are not met to rounding is only a guess of the
active limits; `exact` finishes it, so that the answer does not depend on where the solver started.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import daqp
import numpy as np
import qpsolvers
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.sparse import csc_matrix, issparse, vstack

from fes_pin.allocation.problem import EPSILON, within_rate
from fes_pin.data.errors import InputError

TOLERANCE = 1e-11
"""Violation of a bound that DAQP lets pass: a hundred times what rounding makes of numbers about 1."""
PRECISE = 1e-14
"""Residual, of `lone_steps`, up to which an answer is taken as it is: 50 units of rounding."""
BLOCKS, ROUNDS = 3, 200
"""Exchanges of all wrong limits at once that may bring no progress; exchanges at most (some ten in practice)."""
UNSOLVED = "no solver finds the allocation: torques or moment arms of too different sizes"


def held(r: np.ndarray, multipliers: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Answers (..., n) of DAQP, exactly at the limits that have a multiplier: positive for upper ones."""
    inside = np.minimum(np.maximum(r, lower), upper)
    return np.where(multipliers > 0.0, upper, np.where(multipliers < 0.0, lower, inside))


def new_model(
    H: np.ndarray, f: np.ndarray, lower: np.ndarray, upper: np.ndarray, rows: np.ndarray | None = None
) -> daqp.Model:
    """A workspace of DAQP, with limits of the variables or of rows of them; it belongs to one thread at a time."""
    model = daqp.Model()
    model.settings = {**model.settings, "primal_tol": TOLERANCE}
    model.setup(H.copy(), f.copy(), np.zeros((0, len(f))) if rows is None else rows.copy(), upper.copy(), lower.copy())
    return model


def scaled(H: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Matrices (..., n, n) with a unit diagonal, and the roots (..., n) of the diagonal by which they were divided."""
    root = np.sqrt(np.diagonal(H, axis1=-2, axis2=-1))
    return H / (root[..., :, None] * root[..., None, :]), root


def lone_steps(
    slope: np.ndarray, r: np.ndarray, lower: np.ndarray, upper: np.ndarray, curvature: np.ndarray
) -> np.ndarray:
    """How far each channel alone would move within its limits, (...) the farthest: 0 exactly at the optimum."""
    far = np.minimum(np.maximum(slope / -curvature, lower - r), upper - r)
    return np.maximum.reduce(np.abs(far), -1)


def solve_once(H: np.ndarray, f: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """The answer (n,) from a cold start, exact.

    Raises
    ------
    InputError
        There is none: the program holds numbers beyond what double precision can tell apart.
    """
    return exact(H, f, BoundedProgram(H).solve(f, lower, upper), lower, upper)


def exact(
    H: np.ndarray, f: np.ndarray, r: np.ndarray, lower: np.ndarray, upper: np.ndarray, precise: float = PRECISE
) -> np.ndarray:
    """The optimum (n,), from any answer: the same if its residual is within `precise`, else by exchange of limits.

    Free channels solve one linear system; limits that push the wrong way are let go and violated ones are taken up, all
    at once while that brings progress, else one by one, which ends (block principal pivoting: Judice and Pires 1994,
    Comput. Oper. Res. 21:587-596; Murty 1974, Linear Algebra Appl. 9:65-108).

    Raises
    ------
    InputError
        See `solve_once`.
    """
    if lone_steps(H @ r + f, r, lower, upper, H.diagonal()) <= precise:
        return r
    S, root = scaled(H)
    c, low, high = f / root, lower * root, upper * root
    at, fixed = np.where(r >= upper, 1, np.where(r <= lower, -1, 0)), lower >= upper
    at[fixed] = 1
    fewest, tries = len(f) + 1, BLOCKS
    for _ in range(ROUNDS):
        x = np.where(at > 0, high, np.where(at < 0, low, 0.0))
        free = np.flatnonzero(at == 0)
        if len(free):
            try:
                factors = cho_factor(S[np.ix_(free, free)], check_finite=False)
            except LinAlgError:
                break
            for _ in range(2):  # the second time refines
                x[free] -= cho_solve(factors, (S @ x + c)[free], check_finite=False)
        slope = S @ x + c
        dust = len(f) * EPSILON * (np.abs(S) @ np.abs(x) + np.abs(c))
        after = np.where((at * slope > dust) & ~fixed, 0, at)
        after[free] = np.where(x[free] > high[free], 1, np.where(x[free] < low[free], -1, 0))
        wrong = np.flatnonzero(after != at)
        if not len(wrong):
            return np.where(at > 0, upper, np.where(at < 0, lower, np.clip(x / root, lower, upper)))
        progress = len(wrong) < fewest
        fewest, tries = (len(wrong), BLOCKS) if progress else (fewest, tries - 1)
        if tries < 0:
            wrong = wrong[-1:]
        at[wrong] = after[wrong]
    raise InputError(UNSOLVED)


class BoundedProgram:
    """A bounded program that starts where its last answer was; threads take turns.

    Parameters
    ----------
    H
        (n, n), symmetric positive definite.
    """

    def __init__(self, H: np.ndarray) -> None:
        self.H = H
        unit, self.root = scaled(H)
        n = len(H)
        self._lock, self._bounds = threading.Lock(), (np.zeros(n), np.ones(n))
        self._model = new_model(unit, np.zeros(n), self._bounds[0], self.root)

    def solve(self, f: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """DAQP's answer (n,) for a linear term (n,); where it finds none, one within the limits to begin `exact` at."""
        with self._lock:
            if lower is self._bounds[0] and upper is self._bounds[1]:
                self._model.update(f=f / self.root)
            else:
                self._model.update(f=f / self.root, bupper=upper * self.root, blower=lower * self.root)
                self._bounds = lower, upper
            x, _, flag, info = self._model.solve()
        if flag != 1:
            return np.clip(-f / self.H.diagonal(), lower, upper)
        return held(x / self.root, info["lam"], lower, upper)


def solve_sequence(
    H: Any,
    F: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    keep: float = 0.0,
    rate: float = np.inf,
    previous: np.ndarray | None = None,
    precise: float = PRECISE,
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
    precise
        Residual up to which an answer of DAQP is taken as it is, else it is made exact.
    settle
        What to make of sample k's answer before the next one follows from it: of k, answer, the one before, limits.

    Raises
    ------
    InputError
        See `solve_once`.
    """
    count, n = F.shape
    R, before = np.empty((count, n)), np.zeros(n) if previous is None else previous
    each, carries = H.ndim == 3, keep > 0.0 or rate < np.inf
    if not count:
        return R
    if not each and not carries:
        return _solve_alike(H, F, lower, upper, precise)
    unit, root = scaled(H)
    root, low, high = np.broadcast_to(root, (count, n)), lower, upper
    model = new_model(unit[0] if each else unit, F[0] / root[0], lower * root[0], upper * root[0])
    for k in range(count):
        changed: dict[str, Any] = {"H": unit[k]} if each else {}
        if rate < np.inf:
            low, high = within_rate(before, rate, lower, upper)
        if each or rate < np.inf:
            changed |= {"bupper": high * root[k], "blower": low * root[k]}
        f = F[k] - keep * before if keep else F[k]
        model.update(f=f / root[k], **changed)
        x, _, flag, info = model.solve()
        r = held(x / root[k], info["lam"], low, high) if flag == 1 else np.clip(0.0 * low, low, high)
        r = exact(H[k] if each else H, f, r, low, high, precise)
        R[k] = before = r if settle is None else settle(k, r, before, low, high)
    return R


def _solve_alike(H: np.ndarray, F: np.ndarray, lower: np.ndarray, upper: np.ndarray, precise: float) -> np.ndarray:
    """`solve_sequence` where nothing but the linear term changes; conditions are checked for all samples at once."""
    unit, root = scaled(H)
    R, multipliers = np.empty(F.shape), np.empty(F.shape)
    model = new_model(unit, F[0] / root, lower * root, upper * root)
    for k, f in enumerate(F / root):
        model.update(f=f)
        R[k], _, flag, info = model.solve()
        multipliers[k] = info["lam"] if flag == 1 else np.nan
    R = held(R / root, multipliers, lower, upper)
    wrong = ~(lone_steps(R @ H + F, R, lower, upper, H.diagonal()) <= precise)
    for k in np.flatnonzero(wrong).tolist():
        R[k] = exact(H, F[k], R[k], lower, upper, precise)
    return R


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
