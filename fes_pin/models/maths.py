"""Elementary functions on numbers, arrays and CasADi expressions alike."""

from typing import Any

import casadi as ca
import numpy as np

_SYMBOLIC = (ca.SX, ca.MX, ca.DM)


def is_expression(value: Any) -> bool:
    """True of an expression of CasADi."""
    return isinstance(value, _SYMBOLIC)


def _either(symbolic: Any, numeric: Any) -> Any:
    def function(*x: Any) -> Any:
        return symbolic(*x) if any(map(is_expression, x)) else numeric(*x)

    function.__doc__ = f"NumPy's `{numeric.__name__}` of numbers and arrays, CasADi's of its expressions."
    return function


sin, cos, exp, log = (_either(getattr(ca, n), getattr(np, n)) for n in ("sin", "cos", "exp", "log"))
tanh, sqrt, fabs = (_either(getattr(ca, n), getattr(np, n)) for n in ("tanh", "sqrt", "fabs"))
ceil = _either(ca.ceil, np.ceil)
minimum, maximum = _either(ca.fmin, np.minimum), _either(ca.fmax, np.maximum)
where = _either(ca.if_else, np.where)


TURN = 6.283185307179586
"""2 pi, rad per turn."""


def clip(x: Any, low: Any, high: Any) -> Any:
    """`x`, held between `low` and `high`."""
    return minimum(maximum(x, low), high)


def ramp(x: Any) -> Any:
    """`x` where it is positive, else 0."""
    return maximum(x, 0.0)


def power(x: Any, exponent: Any, least: float) -> Any:
    """|x|^exponent, with derivatives that are finite at 0: |x| is sqrt(x^2 + least^2)."""
    return exp(0.5 * exponent * log(x * x + least * least))


def play(follower: Any, position: Any, half_width: Any) -> Any:
    """Return the position of a follower with play: clip(follower, position -+ half_width).

    Strict comparisons, unlike those of `clip`, keep the derivative of the side that pulls also at half width 0.
    """
    low, high = position - half_width, position + half_width
    return where(follower < low, low, where(follower > high, high, follower))


def lag(target: Any, state: Any, time_constant: Any, step: Any) -> tuple[Any, Any]:
    """Return a first-order low pass of `target` that is exact at time constant 0 and never stiff.

    With e = (T^8 + (h/2)^8)^(1/8), h the integration step: x' = (target - x) / e, out = target - T x'.
    The transfer function (1 + (e - T) s) / (1 + e s) has the low pass's delay T. It differs from the low pass where T
    is below a step, and then only above 2/h: e - T is h/2 at T = 0, h/4000 at T = h. Runge-Kutta steps of order four
    are stable down to e = 0.36 h.

    Returns
    -------
    out, rate
        The lagged signal and the time derivative of `state`.
    """
    rate = (target - state) / lag_time(time_constant, step)
    return target - time_constant * rate, rate


def lag_time(time_constant: Any, step: Any) -> Any:
    """Return the delay of the state of `lag`: e, s."""
    shortest = 0.5 * step
    ratio = time_constant / shortest
    fourth = ratio * ratio * ratio * ratio
    return shortest * sqrt(sqrt(sqrt(1.0 + fourth * fourth)))
