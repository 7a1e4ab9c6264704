"""A horizon's plan made exact: limits that seem active are met exactly, wrong ones exchanged.

Steps of a channel that are tied to each other by the rate move as one; a tied group is held if one of its steps is at a
limit, else free. What is free solves one linear system. Where several limits hold one group, as where a channel rises
by the rate from off to saturation, one multiplier follows from the slopes and the others stay as guessed. Limits that
push the wrong way are let go, violated ones taken up, all at once (primal-dual active set: Hintermueller, Ito and
Kunisch 2002, SIAM J. Optim. 13:865-888). From an interior-point method's guess one or two rounds do; they need not end,
then there is no exact plan.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

ROUNDS = 12
SLACK = 1e-11
"""Violations of limits and wrong multipliers up to this are rounding; of slopes that are larger than 1."""


class Limits:
    """Limits of a plan, channel by channel: (n, steps) of the steps and of their changes from the step before.

    Parameters
    ----------
    low, high
        (2 steps - 1, n), of the steps, then of the changes.
    steps, tied
        Length; whether changes are limited.
    no_room
        Limits nearer than this hold a step where it is.
    """

    def __init__(self, low: np.ndarray, high: np.ndarray, steps: int, tied: bool, no_room: float) -> None:
        self.steps, self.tied = steps, tied
        self.low, self.high = np.ascontiguousarray(low[:steps].T), np.ascontiguousarray(high[:steps].T)
        self.fixed = self.high - self.low <= no_room
        self.down, self.up = np.full(self.low.shape, -np.inf), np.full(self.low.shape, np.inf)
        if tied:
            self.down[:, 1:], self.up[:, 1:] = low[steps:].T, high[steps:].T

    def seem(self, u: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which limits and rates, (n, steps) each, hold (1 upper, -1 lower): multiplier greater than slack."""
        at, tie = np.zeros(u.shape), np.zeros(u.shape)
        at[y[:, : self.steps] > np.maximum(self.high - u, 0.0)] = 1.0
        at[-y[:, : self.steps] > np.maximum(u - self.low, 0.0)] = -1.0
        if self.tied:
            change = np.diff(u, axis=1)
            tie[:, 1:][y[:, self.steps :] > np.maximum(self.up[:, 1:] - change, 0.0)] = 1.0
            tie[:, 1:][-y[:, self.steps :] > np.maximum(change - self.down[:, 1:], 0.0)] = -1.0
        at[self.fixed] = 1.0
        return at, tie

    def met(self, u: np.ndarray, y: np.ndarray) -> np.ndarray:
        """A solver's plan (steps, n), at the limits that its multipliers say hold."""
        at, _ = self.seem(u.T, y.T)
        return np.where(at > 0.0, self.high, np.where(at < 0.0, self.low, u.T)).T

    def at(self, at: np.ndarray) -> np.ndarray:
        """The limits that a guess means."""
        return np.where(at > 0.0, self.high, self.low)

    def exchanged(
        self, u: np.ndarray, y: np.ndarray, z: np.ndarray, at: np.ndarray, tie: np.ndarray, slope: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """The next guess: wrong limits let go (`slope` is rounding of multipliers), violated ones taken up."""
        at, tie = np.where(at * y < -slope, 0.0, at), np.where(tie * z < -slope, 0.0, tie)
        at = np.where(np.abs(u - self.at(at)) > SLACK, 0.0, at)
        at = np.where(u > self.high + SLACK, 1.0, np.where(u < self.low - SLACK, -1.0, at))
        if self.tied:
            change = np.diff(u, axis=1)
            above, below = change > self.up[:, 1:] + SLACK, change < self.down[:, 1:] - SLACK
            tie[:, 1:] = np.where(above, 1.0, np.where(below, -1.0, tie[:, 1:]))
        at[self.fixed] = 1.0
        return at, tie


def make_exact(
    curvature: np.ndarray, f: np.ndarray, limits: Limits, near: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray, int] | None:
    """Plan (steps, n), multipliers (2 steps - 1, n) and guesses that it took; None if no guess settled.

    Parameters
    ----------
    curvature, f
        (steps n, steps n) positive definite, and (steps, n).
    limits
        Of the plan.
    near, y
        A plan near the optimum and its multipliers, shapes as they are given back.
    """
    n, steps = limits.low.shape
    order = (np.arange(n)[:, None] + n * np.arange(steps)).ravel()
    H, slope = curvature[np.ix_(order, order)], np.ascontiguousarray(f.T).ravel()
    large = max(1.0, float(np.abs(f).max(initial=0.0)))
    at, tie = limits.seem(near.T, y.T)
    box = y[:steps].T
    for count in range(ROUNDS):
        try:
            u, box, ties = solve_with(H, slope, limits, at, tie, box)
        except LinAlgError:
            return None
        following = limits.exchanged(u, box, ties, at, tie, SLACK * large)
        if all(np.array_equal(a, b) for a, b in zip(following, (at, tie), strict=True)):
            return u.T, np.vstack([box.T, ties[:, 1:].T]), count + 1
        at, tie = following
    return None


def solve_with(
    H: np.ndarray, f: np.ndarray, limits: Limits, at: np.ndarray, tie: np.ndarray, box: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Plan and multipliers of limits and rates, (n, steps) each, if these limits hold and no others.

    `box` are multipliers of limits for those that do not follow.

    Raises
    ------
    LinAlgError
        What is free is not positive definite to rounding.
    """
    start = tie == 0.0
    start[:, 0] = True
    first = np.flatnonzero(start)
    group = np.cumsum(start.ravel()) - 1
    jumps = np.where(tie > 0.0, limits.up, np.where(tie < 0.0, limits.down, 0.0))
    risen = np.cumsum(jumps, axis=1).ravel()
    offset = risen - risen[first][group]
    limit = limits.at(at).ravel()
    every = np.flatnonzero(at)
    held = every[np.argsort(~limits.fixed.ravel()[every], kind="stable")]
    held_groups, which = np.unique(group[held], return_index=True)
    held = held[which]
    level = np.zeros(len(first))
    level[held_groups] = limit[held] - offset[held]
    free = np.ones(len(first), dtype=bool)
    free[held_groups] = False
    if free.any():
        rows = np.add.reduceat(H, first, axis=0)[free]
        system = np.add.reduceat(rows, first, axis=1)[:, free]
        factors = cho_factor(system, overwrite_a=True, check_finite=False)
        for _ in range(2):  # the second time refines
            wrong = rows @ (level[group] + offset) + np.add.reduceat(f, first)[free]
            level[free] -= cho_solve(factors, wrong, check_finite=False)
    u = level[group] + offset
    met = every[np.abs(u[every] - limit[every]) <= SLACK]
    u[met] = limit[met]
    gradient = H @ u + f
    y = np.zeros(len(u))
    y[met] = box.ravel()[met]
    y[held] = 0.0
    y[held] = -np.add.reduceat(gradient + y, first)[held_groups]
    carried = np.cumsum(gradient + y) - (gradient + y)
    z = np.where(start.ravel(), 0.0, carried - carried[first][group])
    shape = limits.low.shape
    return u.reshape(shape), y.reshape(shape), z.reshape(shape)
