"""The horizon's quadratic program, exactly: an interior-point method says what is active, an active set finishes.

    min 1/2 u'Hu + f'u,    lower <= u_k <= upper,    |u_k - u_(k-1)| <= rate

Primal-dual steps with predictor and corrector from a strictly feasible start (Mehrotra 1992, SIAM J. Optim. 2:575-601)
take some ten factorizations whatever the data. Near the optimum multipliers outgrow slacks where a limit holds; those
limits are then met exactly by the method of multipliers, wrong ones are exchanged (primal-dual active set:
Hintermueller, Ito and Kunisch 2002, SIAM J. Optim. 13:865-888). Should that not settle, the interior iterate stays.

Rows, (2 steps - 1, n) flat, are the steps' limits, then those of their changes; without a rate only the first. Plain
Python; `Native` makes machine code of it.
"""

from __future__ import annotations

from functools import lru_cache

from fes_pin.stimulate.chains import (
    FUNCTIONS,
    chain,
    couple,
    differences,
    direction,
    eliminate,
    gather,
    slopes,
)
from fes_pin.stimulate.native import Native, Reals


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
    small = 1e-3 * tolerance
    slopes(n, r, steps, keep, V, VT, price, change, f, u, t, work, g)
    if begun == 0:
        differences(n, steps, rows, u, d)
        most = 0.0
        for i in range(size):
            slope = abs(g[i]) if held[i] == 0.0 else 0.0
            most = slope if slope > most else most
        start = 0.1 * most
        start = 1e-6 if start < 1e-6 else 1.0 if start > 1.0 else start
        for i in range(every):
            below[i] = d[i] - low[i]
            above[i] = high[i] - d[i]
        for i in range(size):
            below[i] = below[i] if held[i] == 0.0 else 1.0
            above[i] = above[i] if held[i] == 0.0 else 1.0
        for i in range(every):
            z[i] = start / below[i]
            z[every + i] = start / above[i]
    count = 0
    while True:
        for i in range(every):
            y[i] = z[every + i] - z[i]
        gather(n, steps, rows, y, b)
        dual = 0.0
        for i in range(size):
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
        if (dual <= tolerance or total <= small) and worst <= tolerance or count >= limit:
            break
        count += 1
        mean = total / float(2 * every)
        for i in range(every):
            springs[i] = z[i] / below[i] + z[every + i] / above[i]
        factor(n, r, steps, rows, keep, change, V, VT, price, held, springs, ratio, inverse, Q, W, K, p, c)
        for i in range(size):
            b[i] = -g[i]
        direction(n, r, steps, keep, V, VT, ratio, inverse, K, p, t, work, b)
        differences(n, steps, rows, b, d)
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
        target = share * share * share * mean
        for i in range(every):  # y: what the corrector asks of the multipliers, over slacks
            one = d[i] / below[i]
            two = -d[i] / above[i]
            d[i] = target / below[i] + one * (1.0 + one) * z[i]
            y[i] = target / above[i] + two * (1.0 + two) * z[every + i]
            y[i] = y[i] - d[i]
            springs[i] = d[i]
        gather(n, steps, rows, y, b)
        for i in range(size):
            b[i] = -g[i] - b[i]
        direction(n, r, steps, keep, V, VT, ratio, inverse, K, p, t, work, b)
        differences(n, steps, rows, b, d)
        most = 1e-300
        for i in range(every):
            one = -d[i] / below[i]
            two = d[i] / above[i]
            three = 1.0 - one - springs[i] / z[i]
            four = 1.0 - two - (springs[i] + y[i]) / z[every + i]
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
            z[every + i] += a * (springs[i] + y[i] - z[every + i] * (1.0 + two))
            z[i] += a * (springs[i] - z[i] * (1.0 + one))
            below[i] += a * d[i]
            above[i] -= a * d[i]
        for i in range(size):
            u[i] += a * b[i]
        slopes(n, r, steps, keep, V, VT, price, change, f, u, t, work, g)
    return count


def finish(
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
    guess: Reals,
    y: Reals,
    g: Reals,
    b: Reals,
    d: Reals,
    rounds: int,
    stiff: float,
    slack: float,
):
    """Make u and y exact for the limits in `guess` (1 upper, -1 lower, 0 free), exchanging wrong ones.

    The number of guesses, or 0 if none settled within so many rounds.
    """
    size = n * steps
    every = n * rows
    for count in range(rounds):
        for i in range(every):
            springs[i] = stiff if guess[i] != 0.0 else 0.0
            y[i] = y[i] if guess[i] * y[i] > 0.0 else 0.0
        factor(n, r, steps, rows, keep, change, V, VT, price, held, springs, ratio, inverse, Q, W, K, p, c)
        for again in range(8):
            slopes(n, r, steps, keep, V, VT, price, change, f, u, t, work, g)
            differences(n, steps, rows, u, d)
            missed = 0.0
            for i in range(every):
                d[i] = springs[i] * (d[i] - (high[i] if guess[i] > 0.0 else low[i]))
                y[i] += d[i] if again > 0 else 0.0
                missed = abs(d[i]) if abs(d[i]) > missed else missed
            gather(n, steps, rows, y, b)
            for i in range(size):
                b[i] = -g[i] - b[i]
                off = abs(b[i]) if held[i] == 0.0 else 0.0
                missed = off if off > missed else missed
            if missed < slack:
                break
            gather(n, steps, rows, d, work)
            for i in range(size):
                b[i] -= work[i]
            direction(n, r, steps, keep, V, VT, ratio, inverse, K, p, t, work, b)
            for i in range(size):
                u[i] += b[i]
        differences(n, steps, rows, u, d)
        wrong = 0 if missed < slack else 1
        for i in range(every):
            free = 1.0 if i >= size or held[i if i < size else 0] == 0.0 else 0.0
            now = guess[i]
            now = 0.0 if now * y[i] < -slack else now
            now = 1.0 if d[i] > high[i] + slack else -1.0 if d[i] < low[i] - slack else now
            now = now * free
            wrong += 1 if now != guess[i] else 0
            guess[i] = now
        if wrong == 0:
            return count + 1
    return 0


@lru_cache(maxsize=1)
def compiled() -> Native:
    """The functions above as machine code."""
    return Native(*FUNCTIONS, factor, centre, interior, finish)
