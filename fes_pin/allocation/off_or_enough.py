"""Channels that are off or at least so much: the choice that costs least, by DAQP's binary variables.

Each channel that may choose has a variable z, 0 or 1, with least z <= r <= upper z. A price `CURVATURE / 2 (z^2 - z)`,
which is 0 where z is 0 or 1, makes the program strictly convex without changing the cost of any choice.
"""

from dataclasses import dataclass

import daqp
import numpy as np

from fes_pin.allocation.bounded import solve_once

BINARY = 16
"""Flag of DAQP for a constraint that is active at one of its two limits."""
CURVATURE = 1e-3
"""Of the strongest channel's: less makes the factorization lose digits, more makes the relaxation less tight."""
FEASIBLE = 1e-9
"""Tolerance of DAQP on a binary variable."""
ENDED, STOPPED = 1, 5
WITHOUT_LIMIT = 1e30


@dataclass(frozen=True, slots=True)
class Choice:
    """The best choice found.

    Attributes
    ----------
    r
        (n,), each 0 or between its least recruitment and its upper limit.
    cost, gap
        `1/2 r'Hr + f'r`, and how much less any other choice could cost at most: 0 if the search, DAQP's branch and
        bound, ended.
    nodes
        Subproblems solved.
    """

    r: np.ndarray
    cost: float
    gap: float
    nodes: int


def cost_of(H: np.ndarray, f: np.ndarray, r: np.ndarray) -> float:
    """`1/2 r'Hr + f'r`."""
    return float(0.5 * r @ H @ r + f @ r)


def settled(
    H: np.ndarray, f: np.ndarray, lower: np.ndarray, upper: np.ndarray, least: np.ndarray, on: np.ndarray
) -> np.ndarray:
    """The best recruitments with these channels on and the others off."""
    low, high = np.where(on, np.maximum(lower, least), 0.0), np.where(on, upper, 0.0)
    return solve_once(H, f, low, high)


def rounded_to_least(H: np.ndarray, f: np.ndarray, lower: np.ndarray, upper: np.ndarray, least: np.ndarray) -> Choice:
    """The cheap choice: solve without least recruitments, round what lies below to off or to its least, solve again.

    The gap is measured against the problem without least recruitments: true, but not tight.
    """
    relaxed = solve_once(H, f, lower, upper)
    on = (relaxed >= 0.5 * least) & (relaxed > 0.0) & (np.maximum(least, lower) <= upper) | (lower > 0.0)
    r = settled(H, f, lower, upper, least, on)
    cost = cost_of(H, f, r)
    return Choice(r, cost, max(cost - cost_of(H, f, relaxed), 0.0), 2)


def best_choice(
    H: np.ndarray, f: np.ndarray, lower: np.ndarray, upper: np.ndarray, least: np.ndarray, *, seconds: float
) -> Choice:
    """The choice r in {0} or [least, upper] of least cost `1/2 r'Hr + f'r`.

    Parameters
    ----------
    H, f
        (n, n) positive definite, (n,).
    lower, upper, least
        (n,). Where lower > 0 a channel may not be off; where least > upper it can only be off.
    seconds
        Stop the search after this time; the gap then says how good the answer is.
    """
    upper = np.where(least > upper, 0.0, upper)
    lower = np.where(lower > 0.0, np.minimum(np.maximum(lower, least), upper), 0.0)
    chooses = np.flatnonzero((least > 0.0) & (lower == 0.0) & (upper > 0.0))
    n, k = len(f), len(chooses)
    curvature = np.zeros((n + k, n + k))
    curvature[:n, :n], curvature[range(n, n + k), range(n, n + k)] = H, CURVATURE
    linear = np.concatenate([f, np.full(k, -0.5 * CURVATURE)])
    rows = np.zeros((2 * k, n + k))
    for at, i in enumerate(chooses):
        rows[[at, k + at], i] = 1.0
        rows[at, n + at], rows[k + at, n + at] = -upper[i], -least[i]
    free = np.full(k, WITHOUT_LIMIT)
    most, fewest = np.concatenate([upper, np.ones(k), np.zeros(k), free]), np.concatenate([lower, np.zeros(k), -free])
    sense = np.zeros(n + 3 * k, dtype=np.intc)
    sense[n : n + k] = BINARY
    model = daqp.Model()
    model.settings = {**model.settings, "primal_tol": FEASIBLE, "time_limit": min(seconds, WITHOUT_LIMIT)}
    model.setup(curvature, linear, rows, most, np.concatenate([fewest, np.zeros(k)]), sense)
    x, _, flag, info = model.solve()
    on, nodes = upper > 0.0, info["nodes"]
    if flag in (ENDED, STOPPED):
        on[chooses] = x[n:] > 0.5
        r = settled(H, f, lower, upper, least, on)
        cost = cost_of(H, f, r)
        if flag == ENDED:
            return Choice(r, cost, 0.0, nodes)
    cheap = rounded_to_least(H, f, lower, upper, least)
    if flag != STOPPED:
        return Choice(cheap.r, cheap.cost, cheap.gap, cheap.nodes + nodes)
    best, reached = (r, cost) if cost < cheap.cost else (cheap.r, cheap.cost)
    return Choice(best, reached, max(reached - (cheap.cost - cheap.gap), 0.0), nodes + cheap.nodes)
