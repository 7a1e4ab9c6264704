"""The horizon's quadratic program by an interior-point method, which tells what is active at the optimum.

    min 1/2 u'Hu + f'u,    lower <= u_k <= upper,    |u_k - u_(k-1)| <= rate

Primal-dual steps with predictor and corrector from a strictly feasible start (Mehrotra 1992, SIAM J. Optim. 2:575-601)
take some ten factorizations whatever the data. Near the optimum multipliers outgrow slacks where a limit holds:
`fes_pin.allocate.active_set` makes the answer exact from there.

Rows, (2 steps - 1, n) flat, are the steps' limits, then those of their changes; without a rate only the first. Plain
Python; `Native` makes machine code of it.
"""

from __future__ import annotations

from functools import lru_cache

from fes_pin.allocate.active_set import exchange, finish
from fes_pin.allocate.chains import FUNCTIONS, differences, direction, factor, gather, slopes
from fes_pin.allocate.native import Native, Reals


def centre(n: int, steps: int, rows: int, low: Reals, high: Reals, held: Reals, u: Reals):
    """A plan strictly inside limits and rates: from step to step towards the middle of the limits."""
    for k in range(steps):
        for i in range(n):
            at = k * n + i
            middle = 0.5 * (low[at] + high[at])
            if rows > steps and k > 0:
                most = 0.5 * high[n * (steps + k - 1) + i]
                away = middle - u[at - n]
                middle = u[at - n] + (most if away > most else -most if away < -most else away)
            u[at] = low[at] if held[at] > 0.0 else middle
    return 0


def begin(
    n: int,
    steps: int,
    rows: int,
    low: Reals,
    high: Reals,
    held: Reals,
    u: Reals,
    g: Reals,
    below: Reals,
    above: Reals,
    z: Reals,
    d: Reals,
):
    """Slacks of the plan u and multipliers in proportion to the slope g; held steps get slacks that do not matter."""
    size = n * steps
    every = n * rows
    differences(n, steps, rows, u, d)
    most = 0.0
    for i in range(size):
        slope = abs(g[i]) if held[i] == 0.0 else 0.0
        most = slope if slope > most else most
    start = 0.1 * most
    start = 1e-6 if start < 1e-6 else start
    for i in range(every):
        below[i] = d[i] - low[i]
        above[i] = high[i] - d[i]
    for i in range(size):
        below[i] = below[i] if held[i] == 0.0 else 1.0
        above[i] = above[i] if held[i] == 0.0 else 1.0
    for i in range(every):
        z[i] = start / below[i]
        z[every + i] = start / above[i]
    return 0


def measure(
    n: int,
    steps: int,
    rows: int,
    held: Reals,
    below: Reals,
    above: Reals,
    z: Reals,
    y: Reals,
    g: Reals,
    b: Reals,
    out: Reals,
):
    """y from z; `out` gets the greatest unexplained slope, greatest and summed products of slack and multiplier."""
    every = n * rows
    for i in range(every):
        y[i] = z[every + i] - z[i]
    gather(n, steps, rows, y, b)
    dual = 0.0
    for i in range(n * steps):
        miss = abs(b[i] + g[i]) if held[i] == 0.0 else 0.0
        dual = miss if miss > dual else dual
    total = 0.0
    worst = 0.0
    for i in range(every):
        one = below[i] * z[i]
        two = above[i] * z[every + i]
        total += one + two
        worst = one if one > worst else worst
        worst = two if two > worst else worst
    out[0] = dual
    out[1] = worst
    out[2] = total
    return 0


def aim(every: int, total: float, below: Reals, above: Reals, z: Reals, d: Reals, wanted: Reals, y: Reals):
    """From the predictor's changes d: multipliers that the corrector wants, of lower limits, and upper minus lower."""
    most = 1.0
    for i in range(every):
        one = d[i] / below[i]
        two = -d[i] / above[i]
        one = 1.0 + one if one > -0.5 else -one
        two = 1.0 + two if two > -0.5 else -two
        most = one if one > most else most
        most = two if two > most else most
    a = 1.0 / most
    after = 0.0
    for i in range(every):
        one = d[i] / below[i]
        two = -d[i] / above[i]
        after += below[i] * (1.0 + a * one) * z[i] * (1.0 - a * (1.0 + one))
        after += above[i] * (1.0 + a * two) * z[every + i] * (1.0 - a * (1.0 + two))
    share = after / total
    target = share * share * share * total / float(2 * every)
    for i in range(every):
        one = d[i] / below[i]
        two = -d[i] / above[i]
        wanted[i] = target / below[i] + one * (1.0 + one) * z[i]
        y[i] = target / above[i] + two * (1.0 + two) * z[every + i] - wanted[i]
    return 0


def move(every: int, mean: float, below: Reals, above: Reals, z: Reals, d: Reals, wanted: Reals, y: Reals, out: Reals):
    """Go along the corrector's changes d as far as all stay positive; `out` gets how far."""
    most = 1e-300
    for i in range(every):
        one = -d[i] / below[i]
        two = d[i] / above[i]
        three = 1.0 - one - wanted[i] / z[i]
        four = 1.0 - two - (wanted[i] + y[i]) / z[every + i]
        one = three if three > one else one
        two = four if four > two else two
        most = one if one > most else most
        most = two if two > most else most
    near = 1.0 - 10.0 * mean
    a = (0.99 if near < 0.99 else 0.9999 if near > 0.9999 else near) / most
    a = 1.0 if a > 1.0 else a
    for i in range(every):
        one = d[i] / below[i]
        two = -d[i] / above[i]
        z[every + i] += a * (wanted[i] + y[i] - z[every + i] * (1.0 + two))
        z[i] += a * (wanted[i] - z[i] * (1.0 + one))
        below[i] += a * d[i]
        above[i] -= a * d[i]
    out[0] = a
    return 0


def interior(
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
    t: Reals,
    work: Reals,
    f: Reals,
    low: Reals,
    high: Reals,
    u: Reals,
    below: Reals,
    above: Reals,
    z: Reals,
    y: Reals,
    g: Reals,
    b: Reals,
    d: Reals,
    limit: int,
    tolerance: float,
    begun: int,
):
    """Iterate from u strictly inside; multipliers y of upper minus lower limits; the number of iterations.

    `below`, `above` get the slacks, `z` (2 rows n) the multipliers of lower, then of upper limits; `held` is stiff
    where a limit leaves no room. `begun` is 1 to go on with what an earlier call left in them.
    """
    size = n * steps
    every = n * rows
    slopes(n, r, steps, keep, V, VT, price, change, f, u, t, work, g)
    if begun == 0:
        begin(n, steps, rows, low, high, held, u, g, below, above, z, d)
    count = 0
    while True:
        measure(n, steps, rows, held, below, above, z, y, g, b, c)
        total = c[2]
        settled = c[1] <= tolerance and (c[0] <= tolerance or total <= 1e-3 * tolerance)
        if settled or count >= limit:
            break
        count += 1
        for i in range(every):
            springs[i] = z[i] / below[i] + z[every + i] / above[i]
        factor(n, r, steps, rows, keep, change, V, VT, price, held, springs, ratio, inverse, Q, W, K, p, c)
        for i in range(size):
            b[i] = -g[i]
        direction(n, r, steps, keep, V, VT, ratio, inverse, K, p, t, work, b)
        differences(n, steps, rows, b, d)
        aim(every, total, below, above, z, d, springs, y)
        gather(n, steps, rows, y, b)
        for i in range(size):
            b[i] = -g[i] - b[i]
        direction(n, r, steps, keep, V, VT, ratio, inverse, K, p, t, work, b)
        differences(n, steps, rows, b, d)
        move(every, total / float(2 * every), below, above, z, d, springs, y, c)
        a = c[0]
        for i in range(size):
            u[i] += a * b[i]
        slopes(n, r, steps, keep, V, VT, price, change, f, u, t, work, g)
    return count


@lru_cache(maxsize=1)
def compiled() -> Native:
    """The functions above as machine code."""
    return Native(*FUNCTIONS, centre, begin, measure, aim, move, interior, exchange, finish)
