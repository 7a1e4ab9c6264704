"""Maximisation of a likelihood with noise: parameters and noise in turn (ECM), and then together.

Parameters move by Gauss-Newton steps at constant filter gains (`infer.optimize`), the noise by Fisher scoring
(`infer.scoring`), until neither gains. The gradient of the likelihood includes the change of the gains with the
parameters. Both gradients agree only where the model is right, but the one at constant gains converges from afar. Where
it still predicts a gain that no step reaches, parameters and noise move together by Fisher scoring. Noise starts small:
started large, it explains every error of the model.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fes_pin.infer.covariance import covariance_of
from fes_pin.infer.optimize import WORTH
from fes_pin.infer.optimum import Optimum, minimise
from fes_pin.infer.problem import Problem, Unknowns, normal_equations
from fes_pin.infer.scatter import at_rest
from fes_pin.infer.scoring import LITTLE, NoisyProblem, fisher_scoring

ROUNDS = 12
"""Most alternations of parameters and noise, and most steps of both together."""
ITERATIONS = 6
"""Steps of the parameters between those of the noise."""


def alternate(
    problem: Problem,
    start: Mapping[str, float],
    unknowns: Unknowns | None = None,
    rounds: int = ROUNDS,
    iterations: int = ITERATIONS,
) -> Optimum:
    """Fit parameters and noise in turn, and those of a `NoisyProblem` together where that leads further.

    Returns
    -------
    Optimum
        `sse` is twice the negative log-likelihood. `converged` is False where the rounds ran out. The noise is kept in
        the problem.
    """
    fitted = minimise(problem, start, unknowns, iterations)
    for _ in range(rounds):
        before, moved = fitted.sse, problem.noise_step(fitted.values, fitted.unknowns) >= LITTLE
        if moved or not fitted.converged:
            fitted = minimise(problem, fitted.values, fitted.unknowns, iterations)
        goes_on = fitted.gradient_norm > WORTH and not problem.is_final
        if fitted.sse < before - (WORTH if goes_on else LITTLE):
            continue
        if goes_on and isinstance(problem, NoisyProblem):
            return together(problem, fitted.values, fitted.unknowns)
        return fitted
    return replace(fitted, converged=False)


def together(
    problem: NoisyProblem, start: Mapping[str, float], unknowns: Unknowns | None = None, with_noise: bool = True
) -> Optimum:
    """Fit parameters and noise together, from near the maximum.

    Parameters
    ----------
    with_noise
        Whether the noise moves.
    """
    values, own = dict(start), len(problem.unknown_names)
    for _ in range(ROUNDS if own else 1):
        fitted = minimise(problem, values, unknowns, ROUNDS if own else 0)
        hessian = normal_equations(fitted.parts).hessian
        sizes = dict(zip(fitted.free, np.sqrt(np.diag(hessian)), strict=True))
        reached = fisher_scoring(problem, fitted.values, fitted.unknowns, sizes, ROUNDS, with_noise)
        problem.set_noise(reached.noise)
        values, unknowns = {**fitted.values, **reached.values}, fitted.unknowns
        if reached.gained < LITTLE:
            break
    fitted = minimise(problem, values, unknowns, 0)
    free = np.array([n not in reached.held for n in fitted.free])
    return replace(
        fitted,
        converged=reached.converged,
        gradient_norm=reached.left,
        at_bound=reached.held,
        covariance=covariance_of(normal_equations(at_rest(fitted.parts)).hessian, free),
        together=True,
    )
