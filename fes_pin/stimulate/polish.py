"""From a near answer of the horizon's program to the exact one: guess what is active, solve, correct the guess.

A step that changes as fast as it may is tied to the step before it; ties make groups of steps of one channel that
move together, a group with a step at a limit does not move at all. What is left has no constraint: one Cholesky
factorization. Wrong signs of multipliers release, violated limits activate, all at once (primal-dual active set:
Hintermueller, Ito and Kunisch 2002, SIAM J. Optim. 13:865-888); this need not end, then the near answer stays.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from fes_pin.stimulate.native import Integers, Native, Reals, address

SLACK = 1e-11
"""Violations and wrong multipliers up to this are rounding."""
ROUNDS = 2


def merge(n: int, count: int, H: Reals, place: Integers, row: Reals, out: Reals):
    """Sum rows and columns of H that share a place (-1: none), places rising; `row` holds n numbers."""
    for k in range(count * count):
        out[k] = 0.0
    first = 0
    while first < n:
        last = first + 1
        p = place[first]
        if p >= 0:
            for j in range(n):
                row[j] = H[first * n + j]
            while last < n and place[last if last < n else first] == p:
                for j in range(n):
                    row[j] += H[last * n + j]
                last += 1
            for j in range(n):
                if place[j] >= 0:
                    out[p * count + place[j]] += row[j]
        first = last
    return 0


@lru_cache(maxsize=1)
def compiled() -> Native:
    """`merge` as machine code."""
    return Native(merge)


@dataclass(frozen=True, slots=True, eq=False)
class Exact:
    """Plan (steps, n), multipliers (2 steps - 1, n) of limits and rates, and guesses that it took."""

    u: np.ndarray
    y: np.ndarray
    rounds: int


def polish(H, f, low, high, y, rounds: int = ROUNDS) -> Exact | None:
    """The exact minimiser of `1/2 u'Hu + f'u` under limits and rates, or None.

    Parameters
    ----------
    H
        (n steps, n steps), channels slow, steps fast.
    f
        (steps, n).
    low, high, y
        (2 steps - 1, n): limits of the steps, then of the changes; near multipliers, whose sign is the guess.
    """
    steps, n = f.shape
    low, high, guess = (np.ascontiguousarray(a.T) for a in (low, high, np.sign(np.where(np.abs(y) > SLACK, y, 0.0))))
    pinned = low[:, :steps] == high[:, :steps]
    linear = f.T.ravel()
    for count in range(1, rounds + 1):
        guess[:, :steps][pinned] = -1.0
        found = solve_guess(H, linear, low, high, guess, steps, n)
        if found is None:
            return None
        u, multipliers = found
        rows = np.hstack([u, np.diff(u, axis=1)])
        better = np.where((guess != 0.0) & (multipliers * guess > -SLACK), guess, 0.0)
        side = np.where(rows > high + SLACK, 1.0, np.where(rows < low - SLACK, -1.0, 0.0))
        better = np.where(side != 0.0, side, better)
        clash = (side == guess)[:, 1:steps] & (side != 0.0)[:, 1:steps]  # tied to a step that another limit holds
        better[:, steps:][clash] = 0.0
        better[:, :steps][pinned] = -1.0
        settled = (better == guess) | (multipliers == 0.0) & (better == 0.0)
        if settled.all() and not side.any():
            return Exact(np.clip(u, low[:, :steps], high[:, :steps]).T, multipliers.T.copy(), count)
        guess = better
    return None


def solve_guess(H, linear, low, high, guess, steps: int, n: int):
    """Plan (n, steps) and multipliers (n, 2 steps - 1) if exactly the guessed limits hold; None if that is singular."""
    box, tie = guess[:, :steps], guess[:, steps:]
    head = np.hstack([np.ones((n, 1), dtype=bool), tie == 0.0]).ravel()
    starts, group = np.flatnonzero(head), np.cumsum(head) - 1
    jump = np.where(tie > 0.0, high[:, steps:], np.where(tie < 0.0, low[:, steps:], 0.0))
    offset = np.hstack([np.zeros((n, 1)), np.cumsum(jump, 1)]).ravel()
    offset -= offset[starts][group]
    held = np.flatnonzero(box.ravel())[::-1]
    bound = np.where(box > 0.0, high[:, :steps], low[:, :steps]).ravel()
    value, holder = np.full(len(starts), np.nan), np.full(len(starts), -1)
    value[group[held]], holder[group[held]] = bound[held] - offset[held], held
    free = holder < 0
    u = offset + np.where(free, 0.0, value)[group]
    place = np.where(free, np.cumsum(free) - 1, -1)[group]
    count = int(free.sum())
    reduced, row = np.empty((count, count)), np.empty(n * steps)
    compiled()["merge"](n * steps, count, *(address(a) for a in (H, place, row, reduced)))
    try:
        factor = cho_factor(reduced, check_finite=False)
    except LinAlgError:
        return None
    x = np.zeros(len(starts))
    for _ in range(2):  # the second time refines
        slope = np.add.reduceat(H @ u + linear, starts)[free]
        x[free] = -cho_solve(factor, slope, check_finite=False)
        u = u + x[group]
    slope = H @ u + linear
    total = np.where(free, 0.0, np.add.reduceat(slope, starts))
    running = np.cumsum(slope.reshape(n, steps), 1).ravel()
    running -= (running - slope)[starts][group]
    past = (np.arange(n * steps) >= holder[group]) & (holder >= 0)[group]
    chain = (running - np.where(past, total[group], 0.0)).reshape(n, steps)[:, :-1]
    multipliers = np.zeros((n, 2 * steps - 1))
    multipliers[:, steps:] = np.where(tie != 0.0, chain, 0.0)
    at = holder[~free]
    multipliers[at // steps, at % steps] = -total[~free]
    return u.reshape(n, steps), multipliers
