"""Intervals by profile likelihood: how far one parameter may go, all others fitted again, before the fit is too bad.

An interval holds the values x of a parameter with

    sse(x) - sse < c,   sse(x) the least sum of squared whitened residuals with the parameter at x

where c is the 95 % quantile of a chi-square with one degree of freedom, 3.84. Unlike value +- 1.96 std it need not be
symmetric, and it is right where the sum of squares is no parabola. At a bound the interval is one-sided, and c is the
square of the normal's 95 % quantile, 2.71: a value beyond its end is as unlikely as 5 %.

Source: Venzon and Moolgavkar, A method for computing profile-likelihood-based confidence intervals, Applied Statistics
37 (1988); at a bound, Self and Liang, Asymptotic properties of maximum likelihood estimators and likelihood ratio tests
under nonstandard conditions, Journal of the American Statistical Association 82 (1987).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from scipy.optimize import brentq

from fes_pin.infer.levels import CONFIDENCE_95, SEPARABLE
from fes_pin.infer.optimize import Descent
from fes_pin.infer.problem import Problem, Unknowns

RISE = CONFIDENCE_95**2
"""95 % quantile of a chi-square with one degree of freedom."""
STEPS = 20
"""Fits of the other parameters, at most, for each value of the one; they begin near their end."""
DOUBLINGS = 30
"""An interval whose end is not found within so many doublings of the first step has none."""
EXACT = 1e-4
"""Ends are found to this share of the interval's half."""


def profile_interval(
    problem: Problem, name: str, values: Mapping[str, float], unknowns: Unknowns, step: float, at_bound: bool
) -> tuple[float, float]:
    """The 95 % interval of one parameter by profile likelihood; a bound where there is no end before it.

    Parameters
    ----------
    problem
        What was fitted.
    values, unknowns
        Where the fit ended.
    step
        About how far an end is away; only the time depends on it.
    """
    rise = SEPARABLE if at_bound else RISE
    here, limits = values[name], problem.limits
    least = Descent(problem, values, unknowns).sse

    def too_far(x: float) -> float:
        problem.limits = {**limits, name: (x, x)}
        search = Descent(problem, {**values, name: x}, unknowns)
        search.run(STEPS)
        return min(search.sse - least, 1e9) - rise

    ends = [_end(too_far, here, bound, side * step) for bound, side in zip(limits[name], (-1.0, 1.0), strict=True)]
    problem.limits = limits
    return ends[0], ends[1]


def _end(too_far: Callable[[float], float], here: float, bound: float, step: float) -> float:
    """Where a cost crosses zero between a value and a bound; the bound if it does not."""
    inner = here
    for _ in range(DOUBLINGS):
        outer = max(here + step, bound) if step < 0.0 else min(here + step, bound)
        if outer == inner:
            break
        if too_far(outer) > 0.0:
            return float(brentq(too_far, inner, outer, xtol=EXACT * abs(outer - here), rtol=1e-12))
        inner, step = outer, 2.0 * step
    return bound
