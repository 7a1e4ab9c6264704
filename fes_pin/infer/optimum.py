"""The optimum of a fit: values with their covariance, and the derivatives from which all else follows."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fes_pin.infer.covariance import covariance_of, single_gain
from fes_pin.infer.levels import CONFIDENCE_95, PARAMETER_PENALTY, SEPARABLE
from fes_pin.infer.optimize import Descent
from fes_pin.infer.problem import Linearized, Problem, Unknowns, normal_equations

MAX_ITERATIONS = 60
"""Most steps of a fit; one that has not converged by then says so."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Optimum:
    """The end of a fit.

    Attributes
    ----------
    free
        Names of the fitted parameters.
    parameters
        Value of every parameter by name, fitted or not.
    covariance
        Shape (free, free); infinite for parameters that are not identified, 0 for those at a bound.
    at_bound
        Names of the fitted parameters that ended at a bound and would go beyond it.
    sse
        Sum of squared whitened residuals and of their log-determinants: minus twice the log-likelihood up to a
        constant.
    converged
        False where the steps ran out.
    gradient_norm
        Largest predicted gain of a step of a single free parameter, in twice the log-likelihood: 0 at an optimum.
    unknowns
        Unknowns of each trial.
    parts
        Whitened residuals and sensitivities at the optimum, by trial.
    together
        True where the last steps moved parameters and noise together: steps at constant noise gain nothing there.
    """

    free: tuple[str, ...]
    parameters: Mapping[str, float]
    covariance: np.ndarray
    at_bound: tuple[str, ...]
    sse: float
    converged: bool
    gradient_norm: float
    unknowns: Unknowns
    parts: Sequence[Linearized]
    together: bool = False

    @property
    def values(self) -> dict[str, float]:
        """Values of every parameter by name."""
        return dict(self.parameters)

    @property
    def samples(self) -> int:
        """Number of whitened residuals."""
        return sum(len(p.residual) for p in self.parts)

    @property
    def degrees(self) -> int:
        """Degrees of freedom of the model."""
        return len(self.free)

    @property
    def criterion(self) -> float:
        """Twice the negative log-likelihood, with a penalty for each degree of freedom."""
        return self.sse + PARAMETER_PENALTY * self.degrees

    def place(self, name: str) -> int:
        """Return the place of a fitted parameter in `free` and `covariance`."""
        return self.free.index(name)

    def std(self, name: str) -> float:
        """Return the standard deviation of a fitted parameter: infinite if it is not identified, NaN at its bound.

        An estimate at its bound does not scatter about it; `reach` gives the largest distance of the parameter from it.
        """
        variance = self.covariance[(k := self.place(name)), k]
        return math.nan if name in self.at_bound else float(np.sqrt(variance))

    def reach(self, name: str) -> float:
        """Return half of a parameter's 95 % interval by the quadratic approximation; the whole interval at a bound.

        It is infinite where the parameter is not identified. At a bound, with g and h the slope and curvature of half
        the sum of squares, all other parameters refitted, it is the s with 2 |g| s + h s^2 = 2.71.
        """
        if name not in self.at_bound:
            return CONFIDENCE_95 * self.std(name)
        k, system = self.place(name), normal_equations(self.parts)
        covariance = covariance_of(system.hessian, np.array([n == name or n not in self.at_bound for n in self.free]))
        if not np.isfinite(covariance[k, k]):
            return math.inf
        known = np.isfinite(np.diag(covariance))
        slope = abs(float(covariance[k, known] @ system.gradient[known])) / covariance[k, k]
        return float(SEPARABLE / (slope + math.sqrt(slope**2 + SEPARABLE / covariance[k, k])))

    def interval(self, name: str) -> tuple[float, float]:
        """Return the 95 % interval of a fitted parameter by the quadratic approximation."""
        return self.within(name, -math.inf, math.inf)

    def within(self, name: str, low: float, high: float) -> tuple[float, float]:
        """Return a parameter's 95 % interval by the quadratic approximation, cut at these bounds."""
        value, reach = self.parameters[name], self.reach(name)
        return max(value - reach, low), min(value + reach, high)


def minimise(
    problem: Problem, start: Mapping[str, float], unknowns: Unknowns | None = None, max_iterations: int = MAX_ITERATIONS
) -> Optimum:
    """Fit a problem from a start value of every parameter.

    Parameters
    ----------
    unknowns
        Unknowns of each trial; by default the start values of the problem.
    max_iterations
        Most steps.

    Returns
    -------
    Optimum
        The end of the descent; if it has not converged, `converged` is False.
    """
    search = Descent(problem, start, unknowns)
    done = search.run(max_iterations)
    with np.errstate(all="ignore"):
        system = normal_equations(search.parts)
        free = search.free_now(system.gradient)
        decrement = single_gain(system.hessian, system.gradient, free)
    return Optimum(
        free=problem.free,
        parameters=search.values(search.x),
        covariance=covariance_of(system.hessian, free),
        at_bound=tuple(n for n, f in zip(problem.free, free, strict=True) if not f),
        sse=search.sse,
        converged=done,
        gradient_norm=decrement,
        unknowns=search.unknowns,
        parts=tuple(search.parts),
    )
