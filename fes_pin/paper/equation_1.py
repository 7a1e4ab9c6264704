"""Equation (1) of the paper once more, without the engine, CasADi or Pinocchio: what they are compared with.

In plain numbers it takes a microsecond, so that a controller can use it pulse by pulse.

    J theta'' = (a F_M - l (F_ANT - M g)) sin(theta) + m g l cos(theta) - xi theta'
    F_ANT     = f0 (exp(f1 (theta - theta_r)) - 1), 0 below theta_r

Twins, the position controller, the tests' oracle, the confusion matrix and stories that make their own data take it
from here.
Source: Dombre, Fournier and Coiffet, section II-3-2.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

GRAVITY = 9.81
"""m/s2, as the paper rounds it."""


def antagonist_n(known: Mapping[str, Any], angle_rad: Any) -> Any:
    """F_ANT in N at an angle, a number or an array; `known` holds `f0_n`, `f1_per_rad` and `theta_r_rad`."""
    stretch = known["f1_per_rad"] * (angle_rad - known["theta_r_rad"])
    if isinstance(stretch, np.ndarray):
        return known["f0_n"] * np.expm1(np.maximum(stretch, 0.0))
    return known["f0_n"] * math.expm1(max(stretch, 0.0))


def static_torque_nm(known: Mapping[str, Any], angle_rad: Any, force_n: Any, load_kg: Any, tilt_rad: Any = 0.0) -> Any:
    """The right-hand side of eq. (1) but for the damping, N m; numbers, or arrays of one shape.

    Parameters
    ----------
    known
        `moment_arm_m` a, `com_distance_m` l, `foot_mass_kg` m, and the antagonist's: see `antagonist_n`.
    angle_rad, force_n, load_kg
        theta, F_M and M.
    tilt_rad
        By which gravity acts on the foot at another angle.
    """
    pull = antagonist_n(known, angle_rad) - load_kg * GRAVITY
    cable = known["moment_arm_m"] * force_n - known["com_distance_m"] * pull
    weight = known["foot_mass_kg"] * GRAVITY * known["com_distance_m"]
    m: Any = np if isinstance(angle_rad, np.ndarray) else math
    return cable * m.sin(angle_rad) + weight * m.cos(angle_rad + tilt_rad)


def static_stiffness_nm(known: Mapping[str, Any], angle_rad: float, force_n: float, load_kg: float) -> float:
    """Derivative of `static_torque_nm` with respect to the angle, N m/rad."""
    s, c = math.sin(angle_rad), math.cos(angle_rad)
    antagonist = antagonist_n(known, angle_rad)
    steeper = known["f1_per_rad"] * (antagonist + known["f0_n"]) if angle_rad > known["theta_r_rad"] else 0.0
    cable = known["moment_arm_m"] * force_n - known["com_distance_m"] * (antagonist - load_kg * GRAVITY)
    weight = known["foot_mass_kg"] * GRAVITY * known["com_distance_m"]
    return cable * c - known["com_distance_m"] * steeper * s - weight * s


def halved(torque_nm: Callable[[Any], Any], low: Any, high: Any, times: int) -> Any:
    """Angle in rad between two others at which a torque that falls with it is 0; halved so many times.

    Numbers, or arrays of one shape.
    """
    for _ in range(times):
        middle = 0.5 * (low + high)
        below = torque_nm(middle) > 0.0
        low, high = np.where(below, middle, low)[()], np.where(below, high, middle)[()]
    return 0.5 * (low + high)
