"""Other prices of effort: cubes of recruitment, and effort only after the least torque error is reached."""

import numpy as np
from scipy.linalg import null_space
from scipy.optimize import lsq_linear

from fes_pin.allocation.bounded import BoundedProgram, lone_steps, solve_once
from fes_pin.allocation.problem import EPSILON, Limits

STEPS = 100
FLATTEST = 1e-9
"""Least curvature, of a channel's own at full recruitment, on the way to cubes, which are flat where it is off."""
LEAST_SHARE = 1e-10
"""Price of a channel's effort, of the dearest, below which prices are one to rounding."""


def least_cubes(
    squares: np.ndarray, f: np.ndarray, prices: np.ndarray, change: float, limits: Limits, tolerance: float
) -> tuple[np.ndarray, str]:
    """Minimise `1/2 r'Sr + f'r + prices r^3 / 3 + change/2 r'r` by quadratic programs in turn with a line search.

    Returns the recruitment and a note that is empty when no channel alone would move by more than the tolerance.
    """
    base = squares + change * np.eye(len(f))
    curvature = base.diagonal() + prices

    def cost(r: np.ndarray) -> float:
        return 0.5 * r @ base @ r + f @ r + prices @ r**3 / 3.0

    r = np.clip(np.full(len(f), 0.5), *limits)
    for _ in range(STEPS):
        gradient = base @ r + f + prices * r * r
        if lone_steps(gradient, r, *limits, curvature) <= tolerance:
            return r, ""
        H = base + np.diag(np.maximum(2.0 * prices * r, FLATTEST * curvature))
        step = solve_once(H, gradient - H @ r, *limits) - r
        length, now = 1.0, cost(r)
        dust = 8.0 * EPSILON * abs(now)
        while length > 1e-6 and cost(r + length * step) > now + dust + 1e-4 * length * (gradient @ step):
            length *= 0.5
        r = np.clip(r + length * step, *limits)
    return r, f"not converged in {STEPS} quadratic programs"


def error_then_effort(
    rows: np.ndarray, wanted: np.ndarray, total: np.ndarray, target: np.ndarray, limits: Limits
) -> tuple[np.ndarray, str]:
    """Least `|rows r - wanted|` within limits; among its minimisers the least `total (r - target)^2`.

    The first is a bounded least-squares problem; what leaves its torque as it is, the null space of the rows, is then
    moved along to the least of the second, a quadratic program within the limits.

    Returns the recruitment and a note with the slope of the second cost along the null space that no limit explains.
    """
    lower, upper = limits
    r, open_ = lower.copy(), lower < upper
    if open_.any():
        room = np.zeros(open_.sum()), (upper - lower)[open_]
        r[open_] += lsq_linear(rows[:, open_], wanted - rows @ lower, room, "bvls", 1e-15, max_iter=10 * len(r)).x
    root = np.sqrt(np.maximum(total / total.max(), LEAST_SHARE))
    along = null_space(rows / root, rcond=len(r) * EPSILON) / root[:, None]
    if not along.shape[1]:
        return r, "one choice alone has the least error, to 0"
    slope = root**2 * (r - target)
    endless = np.full(along.shape[1], np.inf)
    left = np.append(-endless, lower - r), np.append(endless, upper - r)
    moved, y = (each[0] for each in BoundedProgram(np.eye(len(endless)), along).solve(slope[None] @ along, *left))
    if np.isnan(y).any():
        return r, "least error; the least effort among its choices was not found"
    unexplained = along.T @ (slope + root**2 * (along @ moved) + y[len(endless) :])
    return np.clip(r + along @ moved, lower, upper), f"least effort among equals, to {np.abs(unexplained).max():.0e}"
