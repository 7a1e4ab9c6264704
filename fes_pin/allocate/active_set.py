"""The horizon's quadratic program made exact: limits that seem active are met, wrong ones exchanged.

The method of multipliers meets the limits of a guess (one factorization, a few solutions); limits that push the wrong
way are let go, violated ones taken up, all at once (primal-dual active set: Hintermueller, Ito and Kunisch 2002, SIAM
J. Optim. 13:865-888). From the interior-point method's guess one or two rounds do; they need not end, then the interior
plan stays. Plain Python; `Native` makes machine code of it.
"""

from __future__ import annotations

from fes_pin.allocate.chains import differences, direction, factor, gather, slopes
from fes_pin.allocate.native import Reals


def exchange(
    size: int,
    every: int,
    slack: float,
    large: float,
    held: Reals,
    low: Reals,
    high: Reals,
    y: Reals,
    d: Reals,
    guess: Reals,
):
    """Let go of limits that push the wrong way, take up those that rows d violate; the number of changes."""
    wrong = 0
    for i in range(every):
        now = 0.0 if guess[i] * y[i] < -slack * large else guess[i]
        now = 1.0 if d[i] > high[i] + slack else -1.0 if d[i] < low[i] - slack else now
        now = now if i >= size or held[i if i < size else 0] == 0.0 else 0.0
        wrong += 1 if now != guess[i] else 0
        guess[i] = now
    return wrong


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
    large: float,
):
    """Make u and y exact for the limits in `guess` (1 upper, -1 lower, 0 free), exchanging wrong ones.

    The number of guesses, or 0 if none settled within so many rounds. `slack` is rounding of plans, times `large` of
    slopes.
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
            if missed < slack * large:
                break
            gather(n, steps, rows, d, work)
            for i in range(size):
                b[i] -= work[i]
            direction(n, r, steps, keep, V, VT, ratio, inverse, K, p, t, work, b)
            for i in range(size):
                u[i] += b[i]
        differences(n, steps, rows, u, d)
        wrong = exchange(size, every, slack, large, held, low, high, y, d, guess)
        if wrong == 0 and missed < slack * large:
            return count + 1
    return 0
