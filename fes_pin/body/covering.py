"""The fewest inputs that meet every one of several demands, each a set of linear inequalities: Benders' decomposition.

A covering program chooses inputs. Where the chosen fail a demand, the multipliers of the least violation say how much
each input, chosen or not, could take off it: what a set takes off together must be at least the violation. Such rows
hold for every answer, so the first choice that meets all demands is a smallest one (J. Benders, "Partitioning
procedures for solving mixed-variables programming problems", Numer. Math. 4:238-252, 1962).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import optimize, sparse

from fes_pin.body.programs import FEASIBLE, LinearProgram, linprog

_CUTS_A_ROUND = 4
_DUST = 1e-12
"""A multiplier this small against the largest is rounding."""


@dataclass(frozen=True)
class Demand:
    """Inequalities that some inputs must meet.

    Parameters
    ----------
    program
        The inequalities, with columns of all inputs; its cost does not count.
    owner
        The input that each column belongs to: (columns,) int. An input that is not chosen stays at 0.
    """

    program: LinearProgram = field(repr=False)
    owner: np.ndarray

    def shortfall(self, chosen: np.ndarray) -> tuple[np.ndarray, float] | None:
        """None where the chosen inputs, (m,) bool, meet the demand; else row and need: row z >= need of any that do.

        The least violation of all inequalities alike is a linear program; its multipliers price every input.
        """
        p, used = self.program, chosen[self.owner]
        rows, limits = np.vstack([p.A_eq, -p.A_eq, p.A_ub]), np.concatenate([p.b_eq, -p.b_eq, p.b_ub])
        if not len(rows):
            return None
        violated = sparse.csr_array(np.column_stack([rows[:, used], -np.ones(len(rows))]))
        bounds = np.column_stack([np.append(p.lower[used], 0.0), np.append(p.upper[used], np.inf)])
        found = linprog(np.append(np.zeros(used.sum()), 1.0), violated, limits, bounds=bounds)
        if found.status != 0:
            raise RuntimeError(f"the least violation was not found: {found.message}")
        if found.fun <= FEASIBLE:
            return None
        price = np.maximum(-found.ineqlin.marginals, 0.0)
        slope = price @ rows
        slope[np.abs(slope) <= _DUST * price.max() * np.abs(p.A_ub).max(initial=1.0)] = 0.0
        with np.errstate(invalid="ignore"):
            helps = np.maximum(np.nan_to_num(-slope * p.lower), np.nan_to_num(-slope * p.upper))
        return np.bincount(self.owner, np.maximum(helps, 0.0), len(chosen)), float(-price @ limits)


def smallest(
    count: int, rows: np.ndarray, needs: np.ndarray, demands: Sequence[Demand], alternatives: int = 1
) -> list[np.ndarray]:
    """Smallest choices of inputs that cover the rows and meet the demands.

    Parameters
    ----------
    count
        Number of inputs.
    rows, needs
        rows z >= needs of every choice z: (k, m), (k,), needs positive.
    demands
        What a choice must meet besides.
    alternatives
        How many choices of the smallest size to find.

    Returns
    -------
    list of (m,) bool
        Empty where even all inputs fail.
    """
    everything = np.ones(count, dtype=bool)
    if not np.all(rows.sum(axis=1) >= needs) or any(d.shortfall(everything) is not None for d in demands):
        return []
    found: list[np.ndarray] = []
    cover = list(np.minimum(rows / needs[:, None], 1.0))  # of a need of 1; more than enough is enough
    while len(found) < alternatives:
        chosen = _cover(count, cover, found)
        if chosen is None or (found and chosen.sum() > found[0].sum()):
            break
        failed = [short for demand in demands if (short := demand.shortfall(chosen)) is not None]
        for short in failed[:_CUTS_A_ROUND]:
            cover.append(_lacking(chosen, *short))
        if not failed:
            found.append(chosen)
    return found


def _lacking(chosen: np.ndarray, row: np.ndarray, need: float) -> np.ndarray:
    """A row that the failed choice breaks: the inputs of which at least one is needed, as few as can be.

    All those that help least are left out, as long as they and the chosen together still help too little.
    """
    others = np.flatnonzero(~chosen)
    order = others[np.argsort(row[others])]
    enough = row[chosen].sum() + np.cumsum(row[order]) >= need - FEASIBLE
    return np.isin(np.arange(len(chosen)), order[enough]).astype(float)


def _cover(count: int, rows: list[np.ndarray], excluded: list[np.ndarray]) -> np.ndarray | None:
    """Fewest columns that cover the rows, other than the excluded choices; None if there is no such choice."""
    constraints = [optimize.LinearConstraint(np.array(rows), lb=1.0 - 1e-6)] if rows else []
    if excluded:
        apart = np.array(excluded, dtype=float)
        constraints.append(optimize.LinearConstraint(apart, ub=apart.sum(axis=1) - 1.0))
    ones, off_or_on = np.ones(count), optimize.Bounds(0, 1)
    answer = optimize.milp(ones, constraints=constraints, integrality=ones, bounds=off_or_on)
    return np.round(answer.x).astype(bool) if answer.status == 0 else None
