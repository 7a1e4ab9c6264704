"""The maximum of the likelihood of measured trials: parameters and what is random, by turns.

Parameters move by Gauss-Newton steps with the filter's gains as they are (`identify.descent`), what is random by
Fisher scoring (`identify.scoring`), until neither gains. Where steps by slopes for gains as they are still promise
what none of them keeps, slopes are then differences of the cost, in which gains go with the parameters: the two are
one only where a model is right, and it is the first that lead there from afar. A parameter that scales a reading
always has a slope of the second kind. What is random begins small: begun large it takes all that the model gets
wrong.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Protocol

from fes_pin.identify.fit import Fit, fit_problem
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.problem import Unknowns
from fes_pin.identify.scoring import LITTLE, WORTH

ROUNDS = 12
"""Turns of parameters and randomness, at most."""


class TurnsProblem(Protocol):
    """A problem to `Descent` with something random about it."""

    @property
    def is_sharp(self) -> bool:
        """True where slopes are differences of the cost."""

    def score(self, values: Mapping[str, float], unknowns: Unknowns) -> float:
        """Improve what is random, in place; returns by how much that lowers the cost."""

    def sharpen(self) -> bool:
        """Let slopes be differences of the cost; False where they are."""


def by_turns(
    problem: TurnsProblem,
    start: Mapping[str, float],
    unknowns: Unknowns | None = None,
    rounds: int = ROUNDS,
    iterations: int = 6,
) -> Fit:
    """Fit parameters and randomness by turns.

    Returns
    -------
    Fit
        `sse` is twice the negative log-likelihood. `converged` is False where turns ran out.
    """
    fitted = fit_problem(problem, start, unknowns, iterations)  # type: ignore[arg-type]
    for _ in range(rounds):
        before, moved = fitted.sse, problem.score(fitted.values, fitted.unknowns) >= LITTLE
        if moved or problem.is_sharp or not fitted.converged:
            fitted = fit_problem(problem, fitted.values, fitted.unknowns, iterations)  # type: ignore[arg-type]
        if fitted.sse < before - LITTLE:
            continue
        if not (fitted.gradient_norm > WORTH and problem.sharpen()):
            return fitted
        fitted = fit_problem(problem, fitted.values, fitted.unknowns, iterations)  # type: ignore[arg-type]
    return replace(fitted, converged=False)


def maximise(
    problem: LikelihoodProblem,
    start: Mapping[str, float],
    unknowns: Unknowns | None = None,
    rounds: int = ROUNDS,
) -> Fit:
    """The likelihood's maximum; see `by_turns`. The fit's `doubt` is what is random there."""
    return replace(by_turns(problem, start, unknowns, rounds), doubt=problem.doubt)
