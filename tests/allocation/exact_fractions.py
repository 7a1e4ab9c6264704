"""The optimum of an allocation in exact rational arithmetic: an oracle that shares no code with the allocator."""

from fractions import Fraction

import numpy as np


def solved(A, b):
    """Gauss's elimination without rounding."""
    n, rows = len(b), [[*row, value] for row, value in zip(A, b, strict=True)]
    for i in range(n):
        for k in range(i + 1, n):
            if rows[k][i]:
                part = rows[k][i] / rows[i][i]
                rows[k] = [y - part * x for x, y in zip(rows[i], rows[k], strict=True)]
    x = [Fraction(0)] * n
    for i in reversed(range(n)):
        x[i] = (rows[i][n] - sum(rows[i][j] * x[j] for j in range(i + 1, n))) / rows[i][i]
    return x


def fractions(values):
    return [Fraction(float(v)) for v in values]


def optimum(matrix, torque, prices, scale, lower, upper):
    """Recruitments (n,) that minimise |R r - torque|^2 / (2 scale) + prices r^2 / 2 within limits.

    Murty's rule: exchange the first wrong limit until none is; it ends for every positive definite program.
    """
    R, wanted, scale = [fractions(row) for row in matrix], fractions(torque), Fraction(float(scale))
    price, low, high = fractions(prices), fractions(lower), fractions(upper)
    channels, joints = range(len(price)), range(len(wanted))
    H = [[sum(R[j][a] * R[j][b] for j in joints) / scale for b in channels] for a in channels]
    for a in channels:
        H[a][a] += price[a]
    f = [-sum(R[j][a] * wanted[j] for j in joints) / scale for a in channels]
    at = [-1] * len(price)
    while True:
        free = [i for i in channels if not at[i]]
        x = [high[i] if at[i] > 0 else low[i] if at[i] < 0 else Fraction(0) for i in channels]
        held = [f[a] + sum(H[a][b] * x[b] for b in channels) for a in free]
        for i, value in zip(free, solved([[H[a][b] for b in free] for a in free], [-h for h in held]), strict=True):
            x[i] = value
        for i in channels:
            slope = sum(H[i][b] * x[b] for b in channels) + f[i]
            new = (0 if at[i] * slope > 0 else at[i]) if at[i] else 1 if x[i] > high[i] else -1 if x[i] < low[i] else 0
            if new != at[i]:
                at[i] = new
                break
        else:
            return np.array([float(v) for v in x])
