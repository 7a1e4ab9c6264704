"""Quadratic programs with bounds only, `min 1/2 r'Hr + f'r, lower <= r <= upper`, by principal pivoting, warm-started.

For a guess of which variables are free the solution is affine in f; its map P is H with the free variables exchanged
with their gradients (principal pivot transform: Cottle, Pang and Stone, The Linear Complementarity Problem, 1992,
section 4.1). One change of the guess costs one rank-1 update of P; a smooth torque rarely needs one. Pivots go to the
worst violation; should that not end after a while, to the violated variable of least index, which ends for every
positive definite H (Murty 1974, Linear Algebra Appl. 9:65-108). The solution is refined with the given H. The
functions with Reals and Integers are plain Python; `Native` makes machine code of them.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from fes_pin.allocate.native import Integers, Native, Reals, address
from fes_pin.data.errors import InputError

FREE, AT_LOWER, AT_UPPER = 0, 1, 2
PIVOTS_PER_VARIABLE = 60
"""Give up, and say so, after this many pivots per variable."""


def pivot(n: int, i: int, P: Reals):
    """Exchange variable i with its gradient in P, n x n."""
    p = 1.0 / P[i * n + i]
    for k in range(n):
        if k != i:
            a = P[k * n + i] * p
            for j in range(n):
                P[k * n + j] -= a * P[i * n + j]
            P[k * n + i] = a
    for j in range(n):
        P[i * n + j] *= -p
    P[i * n + i] = p
    return 0


def rebuild(n: int, H: Reals, P: Reals, status: Integers):
    """P from H for the free variables that `status` names."""
    for k in range(n * n):
        P[k] = H[k]
    for i in range(n):
        if status[i] == 0:
            pivot(n, i, P)
    return 0


def add_rows(n: int, stride: int, rows: int, a: Reals, A: Reals, out: Reals):
    """out += the sum of a[j] times row j of A (rows of n numbers, `stride` apart), four rows at a time."""
    fours = rows - rows % 4
    for block in range(fours // 4):
        j = 4 * block
        a0 = a[j]
        a1 = a[j + 1]
        a2 = a[j + 2]
        a3 = a[j + 3]
        at = j * stride
        for k in range(n):
            out[k] += (
                a0 * A[at + k] + a1 * A[at + stride + k] + a2 * A[at + 2 * stride + k] + a3 * A[at + 3 * stride + k]
            )
    for j in range(fours, rows):
        a0 = a[j]
        for k in range(n):
            out[k] += a0 * A[j * stride + k]
    return 0


def gradient(n: int, H: Reals, f: Reals, r: Reals, g: Reals):
    """g = H r + f, row by row of the symmetric H."""
    for k in range(n):
        g[k] = f[k]
    add_rows(n, n, n, r, H, g)
    return 0


def respond(n: int, f: Reals, lower: Reals, upper: Reals, P: Reals, status: Integers, r: Reals, g: Reals):
    """Variables and gradients that belong to the guess `status`: P's signs make its transpose do."""
    for k in range(n):
        g[k] = 0.0
        r[k] = f[k] if status[k] == 0 else lower[k] if status[k] == 1 else upper[k]
    add_rows(n, n, n, r, P, g)
    for k in range(n):
        if status[k] == 0:
            r[k] = -g[k]
            g[k] = 0.0
        else:
            r[k] = lower[k] if status[k] == 1 else upper[k]
            g[k] += f[k]
    return 0


def refine(n: int, H: Reals, f: Reals, lower: Reals, upper: Reals, P: Reals, status: Integers, r: Reals, g: Reals):
    """One Newton step of the free variables with the given H, then the exact gradient in g."""
    gradient(n, H, f, r, g)
    for j in range(n):
        if status[j] == 0:
            a = g[j]
            for k in range(n):
                if status[k] == 0:
                    r[k] -= a * P[j * n + k]
    for k in range(n):
        r[k] = lower[k] if r[k] < lower[k] else upper[k] if r[k] > upper[k] else r[k]
    gradient(n, H, f, r, g)
    return 0


def solve(
    n: int,
    H: Reals,
    f: Reals,
    lower: Reals,
    upper: Reals,
    P: Reals,
    status: Integers,
    r: Reals,
    g: Reals,
    limit: int,
    tolerance: float,
):
    """Solve from the guess in `status` and its P; the number of pivots, or minus that number less 1 if it gave up."""
    count = 0
    while True:
        respond(n, f, lower, upper, P, status, r, g)
        worst = -1
        most = tolerance
        for k in range(n):
            violation = 0.0
            if status[k] == 0:
                violation = lower[k] - r[k] if r[k] < lower[k] else r[k] - upper[k]
                if lower[k] == upper[k]:
                    violation = 1e30
            elif lower[k] < upper[k]:
                violation = (-g[k] if status[k] == 1 else g[k]) / H[k * n + k]
            if violation > most and (worst < 0 or count < 4 * n):
                most = violation
                worst = k
        if worst < 0:
            break
        if count >= limit:
            count = -count - 1
            break
        if status[worst] == 0:
            status[worst] = 1 if r[worst] < lower[worst] or lower[worst] == upper[worst] else 2
        else:
            status[worst] = 0
        pivot(n, worst, P)
        count += 1
        if count % 50 == 0:
            rebuild(n, H, P, status)
    refine(n, H, f, lower, upper, P, status, r, g)
    return count


def sequence(
    count: int,
    n: int,
    H: Reals,
    H_step: int,
    F: Reals,
    lower: Reals,
    upper: Reals,
    bound_step: int,
    keep: float,
    rate: float,
    P: Reals,
    status: Integers,
    R: Reals,
    G: Reals,
    failed: Integers,
    work: Reals,
    limit: int,
    tolerance: float,
):
    """Solve samples one after the other, each from the guess of the one before; the number of pivots in all.

    H and the bounds may change per sample (steps 1) or stay (steps 0). `keep` adds keep/2 |r - previous|^2 (H holds its
    diagonal already), `rate` bounds the change per sample. `work` holds 3 n numbers, its first n the previous r.
    """
    pivots = 0
    since = 0
    for k in range(count):
        for i in range(n):
            low = lower[k * bound_step * n + i]
            high = upper[k * bound_step * n + i]
            before = work[i]
            F[k * n + i] -= keep * before
            if before - rate > low:
                low = before - rate if before - rate < high else high
            if before + rate < high:
                high = before + rate if before + rate > low else low
            work[n + i] = low
            work[2 * n + i] = high
        if H_step > 0 or since > 100:
            rebuild(n, H[k * H_step * n * n :], P, status)
            since = 0
        used = solve(
            n,
            H[k * H_step * n * n :],
            F[k * n :],
            work[n:],
            work[2 * n :],
            P,
            status,
            R[k * n :],
            G[k * n :],
            limit,
            tolerance,
        )
        failed[k] = 0
        if used < 0:
            failed[k] = 1
            used = -used - 1
        for i in range(n):
            work[i] = R[k * n + i]
        pivots += used
        since += used
    return pivots


@lru_cache(maxsize=1)
def compiled() -> Native:
    """The functions above as machine code."""
    return Native(pivot, rebuild, add_rows, gradient, respond, refine, solve, sequence)


class BoxProgram:
    """A bounded quadratic program that remembers which bounds were active, to start the next one there.

    Parameters
    ----------
    H
        (n, n), symmetric positive definite.
    tolerance
        Violation of a bound, in units of r, or of a multiplier's sign, in units of r times H's diagonal.
    """

    def __init__(self, H: np.ndarray, tolerance: float = 1e-12) -> None:
        self.n = n = len(H)
        self.H = np.array(H, dtype=float, order="C")
        self.P, self.status = np.empty((n, n)), np.ones(n, dtype=np.int64)
        self.r, self.g, self.f = np.zeros(n), np.zeros(n), np.zeros(n)
        self.lower, self.upper = np.zeros(n), np.ones(n)
        self.native, self.tolerance, self.since = compiled(), tolerance, 0
        arrays = (self.H, self.f, self.lower, self.upper, self.P, self.status, self.r, self.g)
        self.arguments = (n, *(address(a) for a in arrays), PIVOTS_PER_VARIABLE * n, tolerance)
        self.restart()

    def restart(self) -> None:
        """Begin at the guess `status`, P anew."""
        self.native["rebuild"](self.n, address(self.H), address(self.P), address(self.status))
        self.since = 0

    def solve(self, f: np.ndarray) -> bool:
        """Solve for a linear term (n,); the answer is in `r`, its gradient in `g`; whether it was found."""
        self.f[:] = f
        if self.since > 100:
            self.restart()
        pivots = self.native["solve"](*self.arguments)
        self.since += abs(pivots)
        return pivots >= 0


def by_daqp(H, f, lower, upper) -> np.ndarray:
    """The same program by DAQP through qpsolvers, cut to the limits.

    Raises
    ------
    InputError
        DAQP finds no answer either: the program holds numbers beyond what double precision can tell apart.
    """
    import qpsolvers

    r = qpsolvers.solve_qp(H, f, lb=lower, ub=upper, solver="daqp")
    if r is None:
        raise InputError("no solver finds the allocation: torques or moment arms of too different sizes")
    return np.clip(r, lower, upper)


def solve_sequence(H, F, lower, upper, *, keep=0.0, rate=np.inf, previous=None, tolerance=1e-12) -> np.ndarray:
    """Solutions (count, n) of samples in order, each warm-started from the last; where pivoting gives up, DAQP's.

    Parameters
    ----------
    H, F
        (n, n) or (count, n, n), and (count, n).
    lower, upper
        (n,) or (count, n).
    keep, rate, previous
        Price of change and its bound per sample, from `previous` (n,), by default 0.
    """
    F = np.array(F, dtype=float, order="C")
    count, n = F.shape
    H, lower, upper = (np.ascontiguousarray(a, dtype=float) for a in (H, lower, upper))
    if lower.ndim != upper.ndim:
        lower, upper = (np.ascontiguousarray(np.broadcast_to(a, (count, n))) for a in (lower, upper))
    R, start = np.empty((count, n)), 0
    before = np.zeros(n) if previous is None else np.array(previous, dtype=float)
    while start < count:
        each = [a[start:] if a.ndim == d else a for a, d in ((H, 3), (lower, 2), (upper, 2))]
        R[start:], failed = run(each[0], F[start:].copy(), each[1], each[2], keep, rate, before, tolerance)
        carries = keep > 0.0 or rate < np.inf
        for k in start + np.flatnonzero(failed):
            before = R[k - 1] if k > 0 else before
            low, high = (a[k] if a.ndim == 2 else a for a in (lower, upper))
            low, high = np.clip(before - rate, low, high), np.clip(before + rate, low, high)
            R[k] = by_daqp(H[k] if H.ndim == 3 else H, F[k] - keep * before, low, high)
            if carries:  # what follows depends on it
                start, before = int(k) + 1, R[k]
                break
        else:
            break
    return R


def run(H, F, lower, upper, keep: float, rate: float, previous, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """One pass of `sequence` over contiguous arrays (F is used up): solutions, and which samples gave up."""
    count, n = F.shape
    P, status, R, G = np.empty((n, n)), np.ones(n, dtype=np.int64), np.empty((count, n)), np.empty((count, n))
    failed, work = np.zeros(count, dtype=np.int64), np.zeros(3 * n)
    work[:n] = previous
    native = compiled()
    native["rebuild"](n, address(H), address(P), address(status))
    native["sequence"](
        count,
        n,
        address(H),
        int(H.ndim == 3),
        address(F),
        address(lower),
        address(upper),
        int(lower.ndim == 2),
        keep,
        rate,
        *(address(a) for a in (P, status, R, G, failed, work)),
        PIVOTS_PER_VARIABLE * n,
        tolerance,
    )
    return R, failed.astype(bool)
