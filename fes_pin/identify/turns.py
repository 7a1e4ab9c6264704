"""The maximum of the likelihood of measured trials: parameters and what is random, by turns and then together.

Parameters move by Gauss-Newton steps with the filter's gains as they are (`identify.descent`), what is random by
Fisher scoring (`identify.scoring`), until neither gains. Gains that go with the parameters are what the likelihood
demands; the two are one only where a model is right, and it is the first that lead there from afar. Where their slopes
still promise what none of their steps keeps, everything moves together by Fisher scoring. What is random begins small:
begun large it takes all that the model gets wrong.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.identify.covariance import covariance_of
from fes_pin.identify.fit import Fit, fit_problem
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.problem import Unknowns, normal_equations
from fes_pin.identify.scatter import at_rest
from fes_pin.identify.scoring import LITTLE, WORTH, Foretelling, climb
from fes_pin.models.predictor import Doubt

ROUNDS = 12
"""Turns of parameters and randomness, at most; and steps of both together."""


class TurnsProblem(Foretelling, Protocol):
    """A problem to `Descent` with something random about it."""

    unknown_names: tuple[str, ...]

    @property
    def is_final(self) -> bool:
        """True where the end of turns is the end."""

    def score(self, values: Mapping[str, float], unknowns: Unknowns) -> float:
        """Improve what is random, in place; returns by how much that lowers the cost."""

    def become(self, randomness: Mapping[str, float]) -> None:
        """Change what is random, in place."""


def by_turns(
    problem: TurnsProblem,
    start: Mapping[str, float],
    unknowns: Unknowns | None = None,
    rounds: int = ROUNDS,
    iterations: int = 6,
) -> Fit:
    """Fit parameters and randomness by turns, and together where that leads on.

    Returns
    -------
    Fit
        `sse` is twice the negative log-likelihood. `converged` is False where turns ran out.
    """
    fitted = fit_problem(problem, start, unknowns, iterations)  # type: ignore[arg-type]
    for _ in range(rounds):
        before, moved = fitted.sse, problem.score(fitted.values, fitted.unknowns) >= LITTLE
        if moved or not fitted.converged:
            fitted = fit_problem(problem, fitted.values, fitted.unknowns, iterations)  # type: ignore[arg-type]
        goes_on = fitted.gradient_norm > WORTH and not problem.is_final
        if fitted.sse < before - (WORTH if goes_on else LITTLE):
            continue
        return together(problem, fitted.values, fitted.unknowns) if goes_on else fitted
    return replace(fitted, converged=False)


def together(
    problem: TurnsProblem, start: Mapping[str, float], unknowns: Unknowns | None = None, random: bool = True
) -> Fit:
    """Fit parameters and randomness together, from near their end.

    Parameters
    ----------
    random
        Whether what is random moves.
    """
    values, own = dict(start), len(problem.unknown_names)
    for _ in range(ROUNDS if own else 1):
        fitted = fit_problem(problem, values, unknowns, ROUNDS if own else 0)  # type: ignore[arg-type]
        hessian = normal_equations(fitted.parts).hessian
        sizes = dict(zip(fitted.free, np.sqrt(np.diag(hessian)), strict=True))
        reached = climb(problem, fitted.values, fitted.unknowns, sizes, ROUNDS, random)
        problem.become(reached.randomness)
        values, unknowns = {**fitted.values, **reached.values}, fitted.unknowns
        if reached.gained < LITTLE:
            break
    fitted = fit_problem(problem, values, unknowns, 0)  # type: ignore[arg-type]
    free = np.array([n not in reached.held for n in fitted.free])
    return replace(
        fitted,
        converged=reached.converged,
        gradient_norm=reached.left,
        at_bound=reached.held,
        covariance=covariance_of(normal_equations(at_rest(fitted.parts)).hessian, free),
        together=True,
    )


def maximise(
    problem: LikelihoodProblem,
    start: Mapping[str, float],
    unknowns: Unknowns | None = None,
    rounds: int = ROUNDS,
    near: bool = False,
) -> Fit:
    """The likelihood's maximum, what is random there its `doubt`; see `by_turns`, or `together` if it is near."""
    if near and not problem.is_final:
        return replace(together(problem, start, unknowns), doubt=problem.doubt)
    return replace(by_turns(problem, start, unknowns, rounds), doubt=problem.doubt)


def maximum_from(fitted: Fit, trials: Sequence[Trial], doubt: Doubt | None = None) -> Fit:
    """The likelihood's maximum of a fit's model on trials much like its own, from where it ended.

    Parameters
    ----------
    doubt
        What is taken for random at first; by default what was random in the fit.
    """
    begun = doubt or fitted.doubt
    assert begun is not None
    problem = LikelihoodProblem(fitted.model, trials, begun)
    return maximise(problem, fitted.values, fitted.unknowns, near=fitted.together)
