"""Confidence intervals by profile likelihood: the range of one parameter, all others fitted again.

An interval holds the values x of a parameter with

    sse(x) - sse < c,   sse(x) the least sum of squared whitened residuals with the parameter at x

where c is the 95 % quantile of a chi-square with one degree of freedom, 3.84. Unlike value +- 1.96 std it need not be
symmetric, and it is right where the sum of squares is no parabola. At a bound the interval is one-sided, and c is the
square of the normal's 95 % quantile, 2.71.

Source: Venzon and Moolgavkar, A method for computing profile-likelihood-based confidence intervals, Applied Statistics
37 (1988); at a bound, Self and Liang, Asymptotic properties of maximum likelihood estimators and likelihood ratio tests
under nonstandard conditions, Journal of the American Statistical Association 82 (1987).
"""

from collections.abc import Callable, Mapping

from scipy.optimize import brentq

from fes_pin.infer.levels import CONFIDENCE_95, SEPARABLE
from fes_pin.infer.optimize import Descent
from fes_pin.infer.problem import Problem, Unknowns

STEPS = 20
"""Most steps of the other parameters for each value of the one; they start near their optimum."""
DOUBLINGS = 30
"""Most doublings of the first step; an interval without an end within these is unbounded."""
EXACT = 1e-4
"""Accuracy of the ends, as a share of half the interval."""


def profile_interval(
    problem: Problem, name: str, values: Mapping[str, float], unknowns: Unknowns, step: float, at_bound: bool
) -> tuple[float, float]:
    """Return the 95 % interval of one parameter by profile likelihood; it ends at a bound where nothing ends it before.

    Parameters
    ----------
    problem
        The problem that was fitted.
    values, unknowns
        The optimum of the fit.
    step
        Approximate distance of an end; only computing time depends on it.
    """
    rise = SEPARABLE if at_bound else CONFIDENCE_95**2
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
    """Return where a function crosses zero between a value and a bound; the bound if it does not."""
    inner = here
    for _ in range(DOUBLINGS):
        outer = max(here + step, bound) if step < 0.0 else min(here + step, bound)
        if outer == inner:
            break
        if too_far(outer) > 0.0:
            return float(brentq(too_far, inner, outer, xtol=EXACT * abs(outer - here), rtol=1e-12))
        inner, step = outer, 2.0 * step
    return bound
