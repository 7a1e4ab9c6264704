"""The horizon's quadratic program by operator splitting (ADMM: Stellato et al. 2020, Math. Prog. Comp. 12:637).

    min 1/2 u'Hu + f'u,  H = S x G + T x 1,  lower <= u_k <= upper,  |u_k - u_(k-1)| <= rate

u stacks the steps' n channels, x is the Kronecker product: S and T couple steps, G channels. The eigenvectors of G
decouple the linear system of every iteration into n systems as small as the number of steps; their inverses are
kept.
"""

from __future__ import annotations

from functools import lru_cache

from fes_pin.stimulate.box import add_rows
from fes_pin.stimulate.native import Native, Reals


def couple(n: int, steps: int, S: Reals, T: Reals, G: Reals, u: Reals, work: Reals, out: Reals):
    """out = (S x G + T x 1) u; `work` holds steps * n numbers."""
    for k in range(steps):
        for i in range(n):
            work[k * n + i] = 0.0
        add_rows(n, n, u[k * n :], G, work[k * n :])
    for k in range(steps * n):
        out[k] = 0.0
    for k in range(steps):
        for m in range(steps):
            s = S[k * steps + m]
            t = T[k * steps + m]
            for i in range(n):
                out[k * n + i] += s * work[m * n + i] + t * u[m * n + i]
    return 0


def backsolve(n: int, steps: int, V: Reals, Vt: Reals, inverse: Reals, b: Reals, work: Reals, out: Reals):
    """out = the solution for b; `inverse` (steps, steps, n) holds the small inverses, one per eigenvector."""
    for k in range(steps):
        for e in range(n):
            work[k * n + e] = 0.0
        add_rows(n, n, b[k * n :], V, work[k * n :])
    for k in range(steps):
        for e in range(n):
            b[k * n + e] = 0.0
        for m in range(steps):
            for e in range(n):
                b[k * n + e] += inverse[(k * steps + m) * n + e] * work[m * n + e]
    for k in range(steps):
        for i in range(n):
            out[k * n + i] = 0.0
        add_rows(n, n, b[k * n :], Vt, out[k * n :])
    return 0


def differences(n: int, steps: int, u: Reals, out: Reals):
    """u itself, then the change of every step but the first."""
    for k in range(n * steps):
        out[k] = u[k]
    for k in range(n, n * steps):
        out[n * (steps - 1) + k] = u[k] - u[k - n]
    return 0


def gather(n: int, steps: int, y: Reals, out: Reals):
    """The transpose of `differences`."""
    for k in range(n * steps):
        out[k] = y[k]
    for k in range(n, n * steps):
        a = y[n * (steps - 1) + k]
        out[k] += a
        out[k - n] -= a
    return 0


def split(
    n: int,
    steps: int,
    S: Reals,
    T: Reals,
    G: Reals,
    V: Reals,
    Vt: Reals,
    inverse: Reals,
    f: Reals,
    low: Reals,
    high: Reals,
    rho: float,
    sigma: float,
    x: Reals,
    z: Reals,
    y: Reals,
    work: Reals,
    out: Reals,
    limit: int,
    tolerance: float,
):
    """Iterate from x, z, y; `work` holds 7 steps n numbers, `out` gets both residuals; the number of iterations."""
    size = n * steps
    rows = n * (2 * steps - 1)
    count = 0
    while count < limit:
        count += 1
        for i in range(rows):
            work[i] = rho * z[i] - y[i]
        gather(n, steps, work, work[2 * size :])
        for i in range(size):
            work[2 * size + i] += sigma * x[i] - f[i]
        backsolve(n, steps, V, Vt, inverse, work[2 * size :], work[4 * size :], work[6 * size :])
        differences(n, steps, work[6 * size :], work)
        for i in range(size):
            x[i] = 1.6 * work[6 * size + i] - 0.6 * x[i]
        for i in range(rows):
            mixed = 1.6 * work[i] - 0.6 * z[i]
            new = mixed + y[i] / rho
            new = low[i] if new < low[i] else high[i] if new > high[i] else new
            y[i] += rho * (mixed - new)
            z[i] = new
        if count % 10 == 0:
            differences(n, steps, x, work)
            primal = 0.0
            for i in range(rows):
                miss = abs(work[i] - z[i])
                primal = miss if miss > primal else primal
            gather(n, steps, y, work[2 * size :])
            couple(n, steps, S, T, G, x, work[4 * size :], work[6 * size :])
            dual = 0.0
            for i in range(size):
                miss = abs(work[2 * size + i] + work[6 * size + i] + f[i])
                dual = miss if miss > dual else dual
            out[0] = primal
            out[1] = dual
            if primal < tolerance and dual < tolerance:
                break
    return count


@lru_cache(maxsize=1)
def compiled() -> Native:
    """The functions above as machine code."""
    return Native(add_rows, couple, backsolve, differences, gather, split)
