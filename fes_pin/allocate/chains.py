"""The linear system of the horizon's program, factored in pieces: channels couple through torque, steps through change.

    (diag(price) x 1 + change D'D + springs + V'V) u = b,    V = strength x lag

A channel's steps are a chain of springs: to a wall (price of effort, held limits) and from step to step (price of
change, held rates). Chains are eliminated step by step in sums and products of positive numbers, so that a spring may
be as stiff as it likes. What couples the chains, torque over time, has r times as many numbers as there are steps, r
the rank of the moment arms: the matrix inversion lemma leaves one system of that size.

Arrays are flat. Steps run slow, channels fast: u[k * n + i]. Plain Python; `Native` makes machine code of it.
"""

from __future__ import annotations

from fes_pin.allocate.box import add_rows
from fes_pin.allocate.native import Reals

__all__ = ["FUNCTIONS"]


def lag(n: int, steps: int, keep: float, u: Reals):
    """Commands to activations, in place: act_k = keep act_(k-1) + (1 - keep) u_k."""
    for i in range(n):
        u[i] = (1.0 - keep) * u[i]
    for k in range(1, steps):
        for i in range(n):
            u[k * n + i] = keep * u[(k - 1) * n + i] + (1.0 - keep) * u[k * n + i]
    return 0


def lag_back(n: int, steps: int, keep: float, u: Reals):
    """The transpose of `lag`, in place."""
    last = n * (steps - 1)
    for i in range(n):
        u[last + i] = (1.0 - keep) * u[last + i]
    for back in range(1, steps):
        at = last - n * back
        for i in range(n):
            u[at + i] = keep * u[at + n + i] + (1.0 - keep) * u[at + i]
    return 0


def differences(n: int, steps: int, rows: int, u: Reals, out: Reals):
    """u itself, then, for more `rows` than steps, the change of every step but the first."""
    for k in range(n * steps):
        out[k] = u[k]
    if rows > steps:
        for k in range(n, n * steps):
            out[n * (steps - 1) + k] = u[k] - u[k - n]
    return 0


def gather(n: int, steps: int, rows: int, y: Reals, out: Reals):
    """The transpose of `differences`."""
    for k in range(n * steps):
        out[k] = y[k]
    if rows > steps:
        for k in range(1, steps):
            for i in range(n):
                a = y[n * (steps + k - 1) + i]
                out[n * k + i] += a
                out[n * (k - 1) + i] -= a
    return 0


def torques(n: int, r: int, steps: int, keep: float, VT: Reals, u: Reals, t: Reals, work: Reals):
    """t (steps, r) = torque over time of commands u; `work` holds n steps numbers."""
    for k in range(n * steps):
        work[k] = u[k]
    lag(n, steps, keep, work)
    for k in range(r * steps):
        t[k] = 0.0
    for k in range(steps):
        add_rows(r, r, n, work[k * n :], VT, t[k * r :])
    return 0


def pulled(n: int, r: int, steps: int, keep: float, V: Reals, t: Reals, out: Reals):
    """out (steps, n) = the transpose of `torques` of t (steps, r)."""
    for k in range(n * steps):
        out[k] = 0.0
    for k in range(steps):
        add_rows(n, n, r, t[k * r :], V, out[k * n :])
    lag_back(n, steps, keep, out)
    return 0


def slopes(
    n: int,
    r: int,
    steps: int,
    keep: float,
    V: Reals,
    VT: Reals,
    price: Reals,
    change: float,
    f: Reals,
    u: Reals,
    t: Reals,
    work: Reals,
    out: Reals,
):
    """out = gradient of the cost at u, with linear term f."""
    torques(n, r, steps, keep, VT, u, t, work)
    pulled(n, r, steps, keep, V, t, out)
    for k in range(steps):
        for i in range(n):
            out[k * n + i] += f[k * n + i] + price[i] * u[k * n + i]
    for i in range(n):
        out[i] += change * u[i]
    for k in range(1, steps):
        for i in range(n):
            a = change * (u[k * n + i] - u[(k - 1) * n + i])
            out[k * n + i] += a
            out[(k - 1) * n + i] -= a
    return 0


def chain(
    n: int,
    steps: int,
    rows: int,
    price: Reals,
    change: float,
    held: Reals,
    springs: Reals,
    ratio: Reals,
    inverse: Reals,
    s: Reals,
):
    """Eliminate the chains. With wall springs e and step springs w, going up the steps,

        ratio_k = w_k / (w_k + s_(k-1)),    s_k = e_k + s_(k-1) ratio_k,    inverse_k = 1 / (s_k + w_(k+1))

    `springs` (rows, n) of limits and rates, `held` (steps, n) stiff walls, `s` n numbers to work with.
    """
    for i in range(n):
        s[i] = price[i] + change + held[i] + springs[i]
    for k in range(1, steps):
        for i in range(n):
            w = change + (springs[(steps + k - 1) * n + i] if rows > steps else 0.0)
            whole = 1.0 / (w + s[i])
            inverse[(k - 1) * n + i] = whole
            ratio[k * n + i] = w * whole
            s[i] = price[i] + held[k * n + i] + springs[k * n + i] + s[i] * w * whole
    for i in range(n):
        inverse[(steps - 1) * n + i] = 1.0 / s[i]
    return 0


def unchain(n: int, steps: int, ratio: Reals, inverse: Reals, b: Reals):
    """Solve the chains for b, in place."""
    for k in range(1, steps):
        for i in range(n):
            b[k * n + i] += ratio[k * n + i] * b[(k - 1) * n + i]
    last = n * (steps - 1)
    for i in range(n):
        b[last + i] *= inverse[last + i]
    for back in range(1, steps):
        at = last - n * back
        for i in range(n):
            b[at + i] = b[at + i] * inverse[at + i] + ratio[at + n + i] * b[at + n + i]
    return 0


def add_products(n: int, rows: int, a: Reals, A: Reals, stride: int, out: Reals, width: int):
    """Four rows of n numbers, `width` apart in `out`, += a (4 x rows) times A (rows x n, `stride` apart)."""
    pairs = rows // 2
    for pair in range(pairs):
        j = 2 * pair
        a0 = a[j]
        b0 = a[j + 1]
        a1 = a[rows + j]
        b1 = a[rows + j + 1]
        a2 = a[2 * rows + j]
        b2 = a[2 * rows + j + 1]
        a3 = a[3 * rows + j]
        b3 = a[3 * rows + j + 1]
        for k in range(n):
            x = A[j * stride + k]
            z = A[j * stride + stride + k]
            out[k] += a0 * x + b0 * z
            out[width + k] += a1 * x + b1 * z
            out[2 * width + k] += a2 * x + b2 * z
            out[3 * width + k] += a3 * x + b3 * z
    for j in range(2 * pairs, rows):
        for k in range(n):
            x = A[j * stride + k]
            out[k] += a[j] * x
            out[width + k] += a[rows + j] * x
            out[2 * width + k] += a[2 * rows + j] * x
            out[3 * width + k] += a[3 * rows + j] * x
    return 0


def couple(
    n: int,
    r: int,
    steps: int,
    keep: float,
    V: Reals,
    VT: Reals,
    ratio: Reals,
    inverse: Reals,
    Q: Reals,
    W: Reals,
    K: Reals,
):
    """K = 1 + V chains^-1 V', its upper triangle, (steps r, steps r); `Q` holds steps^2 n numbers, `W` n steps r."""
    size = n * steps
    for m in range(steps):
        for k in range(size):
            Q[m * size + k] = 0.0
        for i in range(n):
            Q[m * size + m * n + i] = 1.0
        unchain(n, steps, ratio, inverse, Q[m * size :])
        lag(n, steps, keep, Q[m * size :])
    lag(size, steps, keep, Q)
    width = r * steps
    for m in range(steps):
        for i in range(n):
            for k in range(m, steps):
                for j in range(r):
                    W[i * width + k * r + j] = Q[m * size + k * n + i] * VT[i * r + j]
        count = (steps - m) * r
        for a in range(r):
            at = (m * r + a) * width + m * r
            for j in range(count):
                K[at + j] = 0.0
        fours = r // 4
        for block in range(fours):
            at = (m * r + 4 * block) * width + m * r
            add_products(count, n, V[4 * block * n :], W[m * r :], width, K[at:], width)
        for a in range(4 * fours, r):
            at = (m * r + a) * width + m * r
            add_rows(count, width, n, V[a * n :], W[m * r :], K[at:])
    for j in range(width):
        K[j * width + j] += 1.0
    return 0


def eliminate(width: int, K: Reals, p: Reals, a: Reals):
    """K = U' diag(1/p) U in place, upper triangle; `a` holds 4 `width` numbers. What is below the diagonal is lost."""
    fours = width // 4
    for block in range(fours):
        i = 4 * block
        for row in range(4):
            for j in range(i):
                a[row * i + j] = -K[j * width + i + row] * p[j]
        add_products(width - i, i, a, K[i:], width, K[i * width + i :], width)
        for row in range(i, i + 4):
            for j in range(i, row):
                a[j] = -K[j * width + row] * p[j]
            add_rows(width - row, width, row - i, a[i:], K[i * width + row :], K[row * width + row :])
            p[row] = 1.0 / K[row * width + row]
    for i in range(4 * fours, width):
        for j in range(i):
            a[j] = -K[j * width + i] * p[j]
        add_rows(width - i, width, i, a, K[i:], K[i * width + i :])
        p[i] = 1.0 / K[i * width + i]
    return 0


def substitute(width: int, K: Reals, p: Reals, b: Reals):
    """Solve with the factors of `eliminate`, in place."""
    for j in range(width):
        a = b[j] * p[j]
        for k in range(j + 1, width):
            b[k] -= a * K[j * width + k]
        b[j] = a
    for back in range(1, width + 1):
        i = width - back
        one = 0.0
        two = 0.0
        three = 0.0
        four = 0.0
        count = (back - 1) // 4
        for block in range(count):
            k = i + 1 + 4 * block
            one += K[i * width + k] * b[k]
            two += K[i * width + k + 1] * b[k + 1]
            three += K[i * width + k + 2] * b[k + 2]
            four += K[i * width + k + 3] * b[k + 3]
        for k in range(i + 1 + 4 * count, width):
            one += K[i * width + k] * b[k]
        b[i] -= p[i] * (one + two + three + four)
    return 0


def direction(
    n: int,
    r: int,
    steps: int,
    keep: float,
    V: Reals,
    VT: Reals,
    ratio: Reals,
    inverse: Reals,
    K: Reals,
    p: Reals,
    t: Reals,
    work: Reals,
    b: Reals,
):
    """Solve the whole system for b (steps, n), in place; `t` holds steps r numbers, `work` n steps."""
    unchain(n, steps, ratio, inverse, b)
    torques(n, r, steps, keep, VT, b, t, work)
    substitute(r * steps, K, p, t)
    pulled(n, r, steps, keep, V, t, work)
    unchain(n, steps, ratio, inverse, work)
    for k in range(n * steps):
        b[k] -= work[k]
    return 0


def factor(
    n: int,
    r: int,
    steps: int,
    rows: int,
    keep: float,
    change: float,
    V: Reals,
    VT: Reals,
    price: Reals,
    held: Reals,
    springs: Reals,
    ratio: Reals,
    inverse: Reals,
    Q: Reals,
    W: Reals,
    K: Reals,
    p: Reals,
    c: Reals,
):
    """Everything that `direction` needs for these springs."""
    chain(n, steps, rows, price, change, held, springs, ratio, inverse, c)
    couple(n, r, steps, keep, V, VT, ratio, inverse, Q, W, K)
    eliminate(r * steps, K, p, c)
    return 0


FUNCTIONS = (
    *(add_rows, lag, lag_back, differences, gather, torques, pulled, slopes),
    *(chain, unchain, add_products, couple, eliminate, substitute, factor, direction),
)
"""In the order in which they call each other, to be compiled together."""
