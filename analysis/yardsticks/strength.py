"""Maximal voluntary joint torques that others have measured, to hold the table of muscles against."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fes_pin.body.joints import JOINT_NAMES
from fes_pin.muscles.muscles import MuscleTable

GRAVITY = 9.81
"""m/s^2."""


@dataclass(frozen=True)
class StrengthCurve:
    """Isometric torque over one joint's angle: peak cos(width (angle - best)).

    D. E. Anderson, M. L. Madigan, M. A. Nussbaum, "Maximum voluntary joint torque as a function of joint angle and
    angular velocity: model development and application to the lower limb", J. Biomech. 40:3105-3113, 2007, table 3, men
    of 18 to 25 years (coefficients compared with two public codes that cite it; the article was not at hand).

    Parameters
    ----------
    joint, sign
        Of `COORDINATES`, and the direction of the torque: 1 the way the joint's name says.
    peak, spread
        Mean and standard deviation between people, per body weight times height.
    width, best_rad
        Shape, and the angle of the peak.
    from_deg, to_deg
        Where it is compared.
    posture_deg
        The other joints while it is measured: ours to assume, the article was not at hand.
    """

    joint: str
    sign: float
    peak: float
    spread: float
    width: float
    best_rad: float
    from_deg: float
    to_deg: float
    posture_deg: dict[str, float]

    def angles_deg(self, count: int = 11) -> np.ndarray:
        """Angles at which it is compared."""
        return np.linspace(self.from_deg, self.to_deg, count)

    def torque_nm(self, angle_deg, mass_kg: float, height_m: float) -> np.ndarray:
        """Mean torque at angles, N m."""
        size = self.peak * mass_kg * GRAVITY * height_m
        return size * np.cos(self.width * (np.radians(angle_deg) - self.best_rad))


ANDERSON_2007 = {
    "hip extension": StrengthCurve("hip_flexion", -1.0, 0.161, 0.049, 0.958, 0.932, 0.0, 70.0, {"knee_flexion": 60.0}),
    "hip flexion": StrengthCurve("hip_flexion", 1.0, 0.113, 0.025, 0.738, -0.214, -10.0, 60.0, {"knee_flexion": 60.0}),
    "knee extension": StrengthCurve(
        "knee_flexion", -1.0, 0.163, 0.040, 1.258, 1.133, 20.0, 100.0, {"hip_flexion": 80.0}
    ),
    "knee flexion": StrengthCurve("knee_flexion", 1.0, 0.087, 0.015, 0.869, 0.522, 20.0, 100.0, {"hip_flexion": 80.0}),
    "plantarflexion": StrengthCurve(
        "ankle_dorsiflexion", -1.0, 0.095, 0.022, 1.391, 0.408, -30.0, 20.0, {"knee_flexion": 30.0}
    ),
    "dorsiflexion": StrengthCurve(
        "ankle_dorsiflexion", 1.0, 0.033, 0.005, 1.510, -0.187, -30.0, 20.0, {"knee_flexion": 30.0}
    ),
}
"""By action."""

SARABON_2021 = {
    ("knee extension", 20.0): (1.34, 2.23),
    ("knee extension", 60.0): (2.92, 3.45),
    ("knee extension", 90.0): (2.50, 3.06),
    ("knee flexion", 20.0): (0.85, 1.20),
    ("knee flexion", 60.0): (1.15, 1.62),
    ("knee flexion", 90.0): (0.96, 1.54),
}
"""Healthy adult men, N m per kg, 95 % intervals of the pooled mean of 411 studies, at an extended, a middle and a
flexed knee (the angles here are ours): N. Sarabon, Z. Kozinc, M. Perman, "Establishing reference values for isometric
knee extension and flexion strength", Front. Physiol. 12:767941, 2021 (its abstract).
"""

SUGIMOTO_2014 = (1.29, 0.24, 60.0)
"""Hip abduction of men who play sports, standing: N m per kg, its standard deviation between people, and the speed,
degrees per second: D. Sugimoto et al., "Comparison of isokinetic hip abduction and adduction peak torques and ratio
between sexes", Clin. J. Sport Med. 24:422-428, 2014 (its abstract)."""


def muscle_torques(table: MuscleTable, curve: StrengthCurve, angle_deg) -> np.ndarray:
    """What each muscle of a left leg makes at rest, fully active, in the curve's direction: (angles, m) N m.

    Parameters
    ----------
    table
        Its strengths, lengths and moment arms.
    curve
        Which joint and direction, and the posture.
    angle_deg
        (angles,).
    """
    q = np.zeros((len(angle_deg), len(JOINT_NAMES)))
    for joint, degrees in curve.posture_deg.items():
        q[:, JOINT_NAMES.index(f"left_{joint}")] = np.radians(degrees)
    j = JOINT_NAMES.index(f"left_{curve.joint}")
    q[:, j] = np.radians(angle_deg)
    return curve.sign * table.moment_arms(q)[:, j] * table.strength * table.isometric_fraction(q)


def greatest_torque_nm(table: MuscleTable, curve: StrengthCurve, angle_deg) -> np.ndarray:
    """Torque of all muscles that help, fully active, the others silent: (angles,) N m."""
    return np.maximum(muscle_torques(table, curve, angle_deg), 0.0).sum(axis=-1)
