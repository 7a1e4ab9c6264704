"""The fewest inputs that meet every one of several demands, each a set of linear inequalities: Benders' decomposition.

A covering program chooses inputs. Where the chosen fail a demand, the multipliers of the least violation say how much
each input, chosen or not, could take off it: what a set takes off together must be at least the violation. Such rows
hold for every answer, so the first choice that meets all demands is a smallest one (J. Benders, "Partitioning
procedures for solving mixed-variables programming problems", Numer. Math. 4:238-252, 1962).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import optimize, sparse

from fes_pin.body.programs import FEASIBLE, LinearProgram, linprog

_CUTS_A_ROUND, _ROWS_A_ROUND = 4, 20
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
    watched
        Rows of inequalities that were broken before; demands with the same rows may share the list.
    """

    program: LinearProgram = field(repr=False)
    owner: np.ndarray
    watched: list[int] = field(default_factory=list, repr=False)

    def shortfall(self, chosen: np.ndarray) -> tuple[np.ndarray, float] | None:
        """None where the chosen inputs, (m,) bool, meet the demand; else row and need: row z >= need of any that do.

        The least violation of all inequalities alike is a linear program; its multipliers price every input. Only
        inequalities that are broken on the way take part, and are remembered.
        """
        p = self.program
        used = chosen[self.owner]
        columns = p.A_ub[:, used]
        must, given = np.vstack([p.A_eq, -p.A_eq]), np.concatenate([p.b_eq, -p.b_eq])
        bounds = np.column_stack([np.append(p.lower[used], 0.0), np.append(p.upper[used], np.inf)])
        while True:
            rows = np.vstack([must[:, used], columns[self.watched]])
            found = linprog(
                np.append(np.zeros(used.sum()), 1.0),
                A_ub=sparse.csr_array(np.column_stack([rows, -np.ones(len(rows))])) if len(rows) else None,
                b_ub=np.concatenate([given, p.b_ub[self.watched]]) if len(rows) else None,
                bounds=bounds,
            )
            if found.status != 0:
                raise RuntimeError(f"the least violation was not found: {found.message}")
            if found.fun > FEASIBLE:
                break
            over = columns @ found.x[:-1] - p.b_ub
            if not len(over) or over.max() <= FEASIBLE:
                return None
            broken = np.argsort(-over)[:_ROWS_A_ROUND]
            fresh = [int(i) for i in broken if over[i] > FEASIBLE and i not in self.watched]
            if not fresh:  # kept to the solver's tolerance, which the sum of two exceeds
                return None
            self.watched.extend(fresh)
        price = np.maximum(-found.ineqlin.marginals, 0.0)
        slope = price @ np.vstack([must, p.A_ub[self.watched]])
        slope[np.abs(slope) <= _DUST * price.max() * np.abs(p.A_ub).max(initial=1.0)] = 0.0
        with np.errstate(invalid="ignore"):
            helps = np.maximum(np.nan_to_num(-slope * p.lower), np.nan_to_num(-slope * p.upper))
        need = -price @ np.concatenate([given, p.b_ub[self.watched]])
        return np.bincount(self.owner, np.maximum(helps, 0.0), len(chosen)), float(need)


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
        failed = [(demand, short) for demand in demands if (short := demand.shortfall(chosen)) is not None]
        for demand, short in failed[:_CUTS_A_ROUND]:
            cover.append(_lifted(demand, chosen, *short))
        if not failed:
            found.append(chosen)
    return found


def _lifted(demand: Demand, chosen: np.ndarray, row: np.ndarray, need: float) -> np.ndarray:
    """A row that the failed choice breaks: the inputs of which at least one is needed, as few as can be.

    The chosen are grown to a largest set that fails: first by inputs that the multipliers say help too little, then by
    one after the other, those that help least first.
    """
    grown, mends = chosen.copy(), np.zeros(len(chosen), dtype=bool)
    while True:
        left = np.flatnonzero(~grown & ~mends)
        if not len(left):
            return (~grown).astype(float)
        order = left[np.argsort(row[left])]
        enough = row[grown].sum() + np.cumsum(row[order]) >= need - FEASIBLE
        if not enough[0]:
            grown[order[~enough]] = True
            continue
        more = grown.copy()
        more[order[0]] = True
        short = demand.shortfall(more)
        if short is None:
            mends[order[0]] = True
        else:
            grown, (row, need) = more, short


def _cover(count: int, rows: list[np.ndarray], excluded: list[np.ndarray]) -> np.ndarray | None:
    """Fewest columns that cover the rows, other than the excluded choices; None if there is no such choice."""
    constraints = [optimize.LinearConstraint(np.array(rows), lb=1.0 - 1e-6)] if rows else []
    if excluded:
        apart = np.array(excluded, dtype=float)
        constraints.append(optimize.LinearConstraint(apart, ub=apart.sum(axis=1) - 1.0))
    answer = optimize.milp(
        np.ones(count), constraints=constraints, integrality=np.ones(count), bounds=optimize.Bounds(0, 1)
    )
    return np.round(answer.x).astype(bool) if answer.status == 0 else None
