"""Other prices of effort: cubes of recruitment, and effort only after the least torque error is reached."""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.optimize import nnls

from fes_pin.allocation.bounded import BoundedProgram, lone_steps, solve_once
from fes_pin.allocation.problem import EPSILON

STEPS = 100
FLATTEST = 1e-9
"""Least curvature, of a channel's own at full recruitment, on the way to cubes, which are flat where it is off."""
SHARES = (1e-6, 1e-8, 1e-10, 1e-4)
"""Weights of effort, of the torque error's, with which the limits of the lexicographic answer are guessed."""
LEAST_SHARE = 1e-10
"""Weight of a channel's effort, of the strongest's torque error, below which equal channels are one to rounding."""
PRESSED = 1e-10
"""A limit that the torque error presses on by less than this holds for the sake of effort."""


def least_cubes(
    squares: np.ndarray,
    f: np.ndarray,
    prices: np.ndarray,
    change: float,
    lower: np.ndarray,
    upper: np.ndarray,
    tolerance: float,
) -> tuple[np.ndarray, str]:
    """Minimise `1/2 r'Sr + f'r + prices r^3 / 3 + change/2 r'r` by quadratic programs in turn with a line search.

    Returns the recruitment and a note that is empty when no channel alone would move by more than the tolerance.
    """
    base = squares + change * np.eye(len(f))
    curvature = base.diagonal() + prices

    def cost(r: np.ndarray) -> float:
        return 0.5 * r @ base @ r + f @ r + prices @ r**3 / 3.0

    r = np.clip(np.full(len(f), 0.5), lower, upper)
    for _ in range(STEPS):
        gradient = base @ r + f + prices * r * r
        if lone_steps(gradient, r, lower, upper, curvature) <= tolerance:
            return r, ""
        H = base + np.diag(np.maximum(2.0 * prices * r, FLATTEST * curvature))
        step = solve_once(H, gradient - H @ r, lower, upper) - r
        length, now = 1.0, cost(r)
        dust = 8.0 * EPSILON * abs(now)
        while length > 1e-6 and cost(r + length * step) > now + dust + 1e-4 * length * (gradient @ step):
            length *= 0.5
        r = np.clip(r + length * step, lower, upper)
    return r, f"not converged in {STEPS} quadratic programs"


def error_then_effort(
    squares: np.ndarray,
    f: np.ndarray,
    prices: np.ndarray,
    change: float,
    previous: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
) -> tuple[np.ndarray, str]:
    """Least `1/2 r'Sr + f'r`, S possibly singular; among its minimisers the least effort and change.

        prices r^2 / 2 + change / 2 (r - previous)^2

    Effort with a small weight says which limits hold (the answer moves on straight lines as the weight goes to 0, so
    that a small enough one has the limits of the end: Tikhonov's path). With them the answer is a weighed least-norm
    solution, which is checked against the conditions of both stages.

    Returns the recruitment and a note with how well it meets them.
    """
    total = prices + change
    target = change * previous / total
    best, least = np.clip(target, lower, upper), np.inf
    for floor, share in product((0.0, LEAST_SHARE), SHARES):
        weight = np.maximum(share * total / total.max(), floor)
        guess = BoundedProgram(squares + np.diag(weight)).solve(f - weight * target, lower, upper)
        for _ in range(len(f)):
            r = least_norm(squares, f, total, target, guess, (guess > lower) & (guess < upper))
            outside = (r < lower) | (r > upper)
            missed = max(
                float(lone_steps(squares @ r + f, r, lower, upper, np.ones(len(f)))),
                effort_unexplained(squares, f, total, target, r, lower, upper),
            )
            if missed < least:
                best, least = np.clip(r, lower, upper), missed
            if not outside.any():
                break
            guess = np.clip(r, lower, upper)
        if least <= PRESSED:
            break
    return best, f"least effort among equals, to {least:.0e}"


def least_norm(
    squares: np.ndarray, f: np.ndarray, total: np.ndarray, target: np.ndarray, guess: np.ndarray, free: np.ndarray
) -> np.ndarray:
    """The least-error recruitments nearest to `target` in the metric of `total`, the held ones as in the guess."""
    r = guess.copy()
    if free.any():
        root = np.sqrt(total[free])
        slope = squares[free][:, ~free] @ r[~free] + squares[np.ix_(free, free)] @ target[free] + f[free]
        scaled = squares[np.ix_(free, free)] / np.outer(root, root)
        values, vectors = np.linalg.eigh(scaled)
        kept = values > len(f) * EPSILON * max(values[-1], 1e-300)
        along = vectors[:, kept]
        r[free] = target[free] - along @ (along.T @ (slope / root) / values[kept]) / root
    return r


def effort_unexplained(
    squares: np.ndarray,
    f: np.ndarray,
    total: np.ndarray,
    target: np.ndarray,
    r: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
) -> float:
    """Greatest slope of effort and change at equal torque error that neither a price of torque nor a limit explains.

    The best prices are those of least squares, limits' not negative; what the error holds at a limit is not asked.
    """
    slope = total / total.max() * (r - target)
    loose = np.abs(squares @ r + f) <= PRESSED
    if not loose.any():
        return 0.0
    at = np.eye(len(f))
    explains = np.hstack([squares, -squares, at[:, r <= lower], -at[:, r >= upper]])[loose]
    prices, _ = nnls(explains, slope[loose])
    return float(np.abs(explains @ prices - slope[loose]).max())
