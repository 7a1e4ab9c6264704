"""Channels that are off or at least so much: the choice that costs least, proven by branch and bound."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fes_pin.allocate.box import (
    PIVOTS_PER_VARIABLE,
    BoxProgram,
    add_rows,
    gradient,
    pivot,
    rebuild,
    refine,
    respond,
    solve,
)
from fes_pin.allocate.native import Integers, Native, Reals, address

NODES = 20_000
"""Default limit on the number of subproblems."""
ZERO = 1e-12
"""A recruitment below this is off."""


@dataclass(frozen=True, slots=True)
class Choice:
    """The best choice found.

    Attributes
    ----------
    r
        (n,), each 0 or between its least recruitment and its upper limit.
    cost, gap
        `1/2 r'Hr + f'r`, and how much less any other choice could cost at most (0: proven optimal).
    nodes
        Subproblems solved.
    """

    r: np.ndarray
    cost: float
    gap: float
    nodes: int


def worst_choice(n: int, H: Reals, least: Reals, r: Reals):
    """The channel that is farthest from both off and its least recruitment, -1 if every channel has chosen."""
    split = -1
    most = 0.0
    for i in range(n):
        if r[i] > 1e-12 and r[i] < least[i]:
            distance = r[i] if r[i] < least[i] - r[i] else least[i] - r[i]
            loss = distance * distance * H[i * n + i] + 1e-300
            if loss > most:
                most = loss
                split = i
    return split


def search(
    n: int,
    H: Reals,
    f: Reals,
    lower: Reals,
    upper: Reals,
    least: Reals,
    stack: Reals,
    guess: Integers,
    P: Reals,
    status: Integers,
    work: Reals,
    best: Reals,
    out: Reals,
    nodes: int,
    limit: int,
    tolerance: float,
):
    """Depth first; an open box on `stack` is lower, upper (n each) and its parent's cost; `guess` holds its statuses.

    `best` holds the incumbent, `out` its cost and the least cost still open in the end. The number of boxes solved.
    """
    size = 2 * n + 1
    for i in range(n):
        stack[i] = lower[i]
        stack[n + i] = upper[i]
        guess[i] = status[i]
    stack[2 * n] = -1e300
    out[1] = 1e300
    top = 1
    count = 0
    while top > 0 and count < nodes:
        top -= 1
        base = top * size
        if stack[base + 2 * n] < out[0] - tolerance:
            count += 1
            for i in range(n):
                status[i] = guess[top * n + i]
            rebuild(n, H, P, status)
            used = solve(n, H, f, stack[base:], stack[base + n :], P, status, work, work[n:], limit, 1e-12)
            cost = 0.0
            for i in range(n):
                cost += 0.5 * work[i] * (work[n + i] + f[i])
            split = worst_choice(n, H, least, work)
            if used < 0:
                out[1] = stack[base + 2 * n] if stack[base + 2 * n] < out[1] else out[1]
            elif cost < out[0] - tolerance and split < 0:
                out[0] = cost
                for i in range(n):
                    best[i] = work[i] if work[i] > 1e-12 else 0.0
            elif cost < out[0] - tolerance:
                other = base + size
                stack[base + 2 * n] = cost
                for i in range(size):
                    stack[other + i] = stack[base + i]
                status[split] = 1
                for i in range(n):
                    guess[top * n + i] = status[i]
                    guess[(top + 1) * n + i] = status[i]
                on = other if work[split] > 0.5 * least[split] else base
                off = base + other - on
                stack[on + split] = least[split]
                stack[off + n + split] = 0.0
                top += 2
    for k in range(top):
        out[1] = stack[k * size + 2 * n] if stack[k * size + 2 * n] < out[1] else out[1]
    out[1] = out[1] if out[1] < out[0] else out[0]
    return count


@lru_cache(maxsize=1)
def compiled() -> Native:
    """The search as machine code."""
    return Native(pivot, rebuild, add_rows, gradient, respond, refine, solve, worst_choice, search)


def rounded(H, f, lower, upper, least) -> Choice:
    """The cheap choice: solve without least recruitments, round what lies below to off or to its least, solve again.

    The gap is measured against the problem without least recruitments: true, but not tight.
    """
    program = BoxProgram(H)
    program.lower[:], program.upper[:] = lower, upper
    program.solve(f)
    relaxed = 0.5 * program.r @ H @ program.r + f @ program.r
    r = program.r.copy()
    possible = np.maximum(least, lower) <= upper
    on = (r >= 0.5 * least) & (r > ZERO) & possible | (lower > 0.0)
    program.lower[:] = np.where(on, np.maximum(least, lower), 0.0)
    program.upper[:] = np.where(on, upper, 0.0)
    program.status[:] = 1
    program.restart()
    program.solve(f)
    cost = float(0.5 * program.r @ H @ program.r + f @ program.r)
    return Choice(program.r.copy(), cost, max(cost - float(relaxed), 0.0), 2)


def branch_and_bound(H, f, lower, upper, least, *, nodes: int = NODES, tolerance: float = 1e-12) -> Choice:
    """The choice r in {0} or [least, upper] of least cost `1/2 r'Hr + f'r`.

    Parameters
    ----------
    H, f
        (n, n) positive definite, (n,).
    lower, upper, least
        (n,). Where lower > 0 a channel may not be off; where least > upper it can only be off.
    nodes
        Give up after so many subproblems; the gap then says how good the answer is.
    tolerance
        Costs that differ by less are equal.
    """
    n = len(f)
    H, f, least = (np.ascontiguousarray(a, dtype=float) for a in (H, f, least))
    upper = np.where(least > upper, 0.0, upper)
    lower = np.where(lower > 0.0, np.minimum(np.maximum(lower, least), upper), 0.0)
    start = rounded(H, f, lower, upper, least)
    depth = 2 * n + 4
    status, guess = np.ones(n, dtype=np.int64), np.ones(depth * n, dtype=np.int64)
    stack, P, work = np.empty(depth * (2 * n + 1)), np.empty((n, n)), np.empty(2 * n)
    best, out = start.r.copy(), np.array([start.cost, -np.inf])
    arrays = (H, f, lower, upper, least, stack, guess, P, status, work, best, out)
    count = compiled()["search"](n, *(address(a) for a in arrays), nodes, PIVOTS_PER_VARIABLE * n, tolerance)
    gap = float(out[0] - out[1])
    return Choice(best, float(out[0]), gap if gap > tolerance else 0.0, count + start.nodes)
