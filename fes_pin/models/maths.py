"""Elementary functions on numbers, arrays and CasADi expressions alike."""

from __future__ import annotations

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


def clip(x: Any, low: Any, high: Any) -> Any:
    """`x`, held between `low` and `high`."""
    return minimum(maximum(x, low), high)


def ramp(x: Any) -> Any:
    """`x` where it is positive, else 0."""
    return maximum(x, 0.0)
