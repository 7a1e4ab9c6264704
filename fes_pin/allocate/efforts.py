"""Other prices of effort: cubes of recruitment, and effort only after the least torque error is reached."""

from __future__ import annotations

import numpy as np

from fes_pin.allocate.box import BoxProgram

STEPS = 60
CUBE_TOLERANCE = 1e-11
NEARNESS = 1e-6
"""Weight of the distance to the last iterate, of the strongest channel's square: it fades as the iterates settle."""


PRESSED = 1e-10
"""A limit with a larger multiplier than this holds its channel in the second stage, too."""


def natural_residual(gradient, r, lower, upper) -> float:
    """Greatest `|r - clip(r - gradient)|`."""
    return float(np.abs(r - np.clip(r - gradient, lower, upper)).max())


def least_cubes(squares, f, prices, keep, lower, upper) -> tuple[np.ndarray, str]:
    """Minimise `1/2 r'Sr + f'r + prices r^3 / 3 + keep/2 r'r` by sequential quadratic programs with a line search.

    Returns the recruitment and a note that is empty when it converged.
    """
    base = squares + keep * np.eye(len(f))

    def cost(r):
        return 0.5 * r @ base @ r + f @ r + prices @ r**3 / 3.0

    r = np.clip(np.full(len(f), 0.5), lower, upper)
    for _ in range(STEPS):
        gradient = base @ r + f + prices * r * r
        if natural_residual(gradient, r, lower, upper) <= CUBE_TOLERANCE:
            return r, ""
        H = base + np.diag(prices * np.maximum(2.0 * r, 1e-6))
        program = BoxProgram(H)
        program.lower[:], program.upper[:] = lower, upper
        program.solve(gradient - H @ r)
        step, length, now = program.r - r, 1.0, cost(r)
        while length > 1e-6 and cost(r + length * step) > now + 1e-4 * length * (gradient @ step):
            length *= 0.5
        r = np.clip(r + length * step, lower, upper)
    return r, f"not converged in {STEPS} quadratic programs"


def error_then_effort(squares, f, prices, lower, upper) -> tuple[np.ndarray, str]:
    """Least `1/2 r'Sr + f'r`, S possibly singular; among its minimisers the least `prices r^2`.

    The first by proximal steps; the second by the method of multipliers, which holds `S r` where the first left it.
    Returns the recruitment and a note with how well the second was met.
    """
    nearness = NEARNESS * np.eye(len(f))
    program = BoxProgram(squares + nearness)
    program.lower[:], program.upper[:] = lower, upper
    r = np.clip(np.zeros(len(f)), lower, upper)
    for _ in range(STEPS):
        program.solve(f - NEARNESS * r)
        settled = np.abs(program.r - r).max() <= 1e-12
        r = program.r.copy()
        if settled or natural_residual(squares @ r + f, r, lower, upper) <= 1e-13:
            break
    relative = prices / prices.max() * NEARNESS
    second = BoxProgram(squares + np.diag(relative))
    pressed = np.abs(squares @ r + f) > PRESSED  # f is in the range of S: equal torque leaves these at their limit
    second.lower[:], second.upper[:] = np.where(pressed, r, lower), np.where(pressed, r, upper)
    held = squares @ r
    pull = held.copy()
    for _ in range(STEPS):
        second.solve(-pull)
        missed = held - squares @ second.r
        pull += missed
        if np.abs(missed).max() <= 1e-13:
            break
    return second.r.copy(), f"least effort among equals, torque held to {np.abs(missed).max():.0e}"
