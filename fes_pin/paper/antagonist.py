"""The passive antagonist F_ANT(theta) from static trials: loads hung, rest angles read, no stimulation.

At rest eq. (1) leaves    F_ANT(theta) = M g + m g cot(theta),
so each load is a force at a measured angle. The curve f0 (exp(f1 (theta - theta_r)) - 1) is fitted to the *angles*,
because they carry the noise. Source: Dombre, Fournier and Coiffet, section II-2 ("F_ANT is first experimentally
evaluated").
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import between, number, numbers, positive_number
from fes_pin.data.show import Tabulated
from fes_pin.infer.levels import CONFIDENCE_95
from fes_pin.paper.equation_1 import antagonist_n, halved, static_torque_nm

NAMES = ("f0_n", "f1_per_rad", "theta_r_rad")
RESTS_RAD = (0.1, 3.0)
"""Angles in rad that a load can hang at: at 0 and pi its cable pulls along the leg."""
START = (np.log(5.0), np.log(2.0))
"""Logarithms of f0 in N and f1 in 1/rad where the search starts; theta_r starts at the smallest angle less 0.3 rad."""


@dataclass(frozen=True, eq=False)
class Antagonist(Tabulated):
    """A fitted F_ANT.

    Attributes
    ----------
    values
        f0 in N, f1 in 1/rad, theta_r in rad; shape (3,).
    covariance
        Of them, shape (3, 3).
    residual
        Measured minus fitted rest angles, rad, shape (n,).
    """

    values: np.ndarray
    covariance: np.ndarray
    residual: np.ndarray

    along = ("residual",)

    def force(self, angle_rad: np.ndarray) -> np.ndarray:
        """F_ANT in N at angles in rad."""
        return antagonist_n(self.constants, np.asarray(angle_rad, dtype=float))

    def force_std(self, angle_rad: np.ndarray) -> np.ndarray:
        """Standard deviation of F_ANT in N at angles in rad, to first order."""
        slope = _slope(np.asarray(angle_rad, dtype=float), self.values)
        return np.sqrt(np.einsum("...i,ij,...j->...", slope, self.covariance, slope))

    @property
    def constants(self) -> dict[str, float]:
        """Return the numbers of a study's `[rig.passive]`."""
        return dict(zip(NAMES, (float(v) for v in self.values), strict=True))

    def __str__(self) -> str:
        halves = CONFIDENCE_95 * np.sqrt(np.diag(self.covariance))
        units = ("N", "1/rad", "rad")
        rows = zip(NAMES, self.values, halves, units, strict=True)
        return "\n".join(f"  {n:12s} {v:8.4f} [{v - h:.4f}, {v + h:.4f}] {u}" for n, v, h, u in rows)


def _slope(angle: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Derivative of F_ANT by f0, f1, theta_r; shape (..., 3)."""
    f0, f1, start = values
    stretch = np.maximum(angle - start, 0.0)
    grown = np.exp(f1 * stretch)
    return np.stack([grown - 1.0, f0 * stretch * grown, -f0 * f1 * grown * (stretch > 0.0)], axis=-1)


def rest_angles(values: np.ndarray, loads_kg: np.ndarray, foot_mass_kg: float) -> np.ndarray:
    """Angles in rad at which loads rest, shape (n,)."""
    known = {**dict(zip(NAMES, values, strict=True)), "foot_mass_kg": foot_mass_kg}
    known |= {"moment_arm_m": 0.0, "com_distance_m": 1.0}  # no muscle pulls, and the lever does not move the balance
    low, high = np.outer(RESTS_RAD, np.ones(len(loads_kg)))
    return halved(lambda q: static_torque_nm(known, q, 0.0, loads_kg), low, high, 60)


def fit_antagonist(
    loads_kg: Sequence[float], angles_rad: Sequence[float], angle_std_rad: float, foot_mass_kg: float
) -> Antagonist:
    """Fit F_ANT to loads and rest angles.

    Parameters
    ----------
    loads_kg, angles_rad
        One each per static trial, in any order; equal loads may repeat.
    angle_std_rad
        Of a rest angle as read.

    Raises
    ------
    InputError
        For fewer than four loads (the curve has three parameters), numbers that are none, angles that no load hangs at
        (degrees?), or a fit that does not converge.
    """
    loads, angles = numbers(loads_kg, "loads_kg"), numbers(angles_rad, "angles_rad")
    positive_number(angle_std_rad, "angle_std_rad")
    between(number(foot_mass_kg, "foot_mass_kg"), 0.0, np.inf, "foot_mass_kg")
    if loads.shape != angles.shape or loads.ndim != 1 or len(np.unique(loads)) < 4:
        raise InputError("expected an angle for each of at least four different loads to find F_ANT from")
    if not (np.isfinite(loads).all() and (loads >= 0.0).all()):
        raise InputError("expected finite loads of 0 kg or more", column="loads_kg")
    low, high = RESTS_RAD
    if not ((angles >= low) & (angles <= high)).all():
        odd = angles[~((angles >= low) & (angles <= high))][0]
        raise InputError(f"expected {low:g} to {high:g} rad, found {odd:g} (degrees?)", column="angles_rad")

    def values(x: np.ndarray) -> np.ndarray:
        return np.array([np.exp(x[0]), np.exp(x[1]), x[2]])

    def residual(x: np.ndarray) -> np.ndarray:
        return (angles - rest_angles(values(x), loads, foot_mass_kg)) / angle_std_rad

    found = scipy.optimize.least_squares(residual, [*START, angles.min() - 0.3], jac="3-point", x_scale="jac")
    if not found.success or not np.isfinite(found.fun).all() or np.linalg.matrix_rank(found.jac) < len(NAMES):
        raise InputError("no curve fits these loads and angles: the search for F_ANT did not converge")
    to_values = np.diag([*np.exp(found.x[:2]), 1.0])
    covariance = to_values @ np.linalg.pinv(found.jac.T @ found.jac) @ to_values
    return Antagonist(values(found.x), covariance, found.fun * angle_std_rad)
