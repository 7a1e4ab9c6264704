"""The table of muscles: strength, moment arms over posture, fibre length; the right side, mirrored to the left."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

import numpy as np

from fes_pin.body.joints import JOINT_NAMES, MIRROR_SIGN, SIDES, angles_array
from fes_pin.data.errors import InputError

BEYOND = np.radians(10.0)
"""Angles are held within the measured range widened by this much: the table is not extrapolated further."""
FADE = np.radians(20.0)
"""Distance over which what the smooth part of a moment arm leaves over at a measured posture fades."""
ACTIVE_WIDTH = 0.45
"""Width of the Gaussian active force-length curve (Thelen 2003, J. Biomech. Eng. 125:70-77, table 1)."""
SHORTENING_LIMIT = 10.0
"""Fastest shortening, optimal fibre lengths per second (Thelen 2003)."""
HILL_SHAPE = 0.25
"""Curvature a/F0 of Hill's hyperbola (Thelen 2003); lengthening reaches 1.4 times the isometric force."""
LENGTHENING_FORCE = 1.4


def read_table(name: str) -> list[dict[str, str]]:
    """Rows of one of the tables that ship with the package."""
    text = (files("fes_pin.muscles") / "tables" / name).read_text()
    return list(csv.DictReader(text.splitlines()))


def angles_of(q) -> np.ndarray:
    """Joint angles as an array in the order of `JOINT_NAMES`.

    Parameters
    ----------
    q
        Mapping from joint name to angle (absent joints are at 0), or array (..., 19), rad. None: the neutral posture.

    Raises
    ------
    InputError
        Unknown joint, wrong shape, or an angle that is not a number.
    """
    if q is None or hasattr(q, "keys"):
        return angles_array(q or {}, JOINT_NAMES)
    try:
        angles = np.asarray(q, dtype=float)
    except (TypeError, ValueError):
        raise InputError("joint angles must be numbers") from None
    if angles.shape[-1:] != (len(JOINT_NAMES),):
        raise InputError(f"expected {len(JOINT_NAMES)} joint angles, got an array of shape {angles.shape}")
    if not np.isfinite(angles).all():
        name = JOINT_NAMES[int(np.argwhere(~np.isfinite(angles))[0][-1])]
        raise InputError(f"the angle of {name} is not a finite number")
    return angles


@dataclass(frozen=True)
class MuscleTable:
    """Muscles of both sides and the moment arms that they have over posture.

    A moment arm is the gradient of one quadratic muscle length, `arm = constant + slope q` with symmetric slope, so
    that force times shortening is torque times rotation, fitted to the measured postures; what this leaves over there
    (at most a few mm) is added back with weights that fade away from them: measured postures are met exactly.

    Attributes
    ----------
    names, nerves
        One per muscle, with its side: `right_soleus`, `right_tibial`.
    strength, fibre, tendon, neutral_length, pennation
        (m,) N, m, m, m, rad.
    constant, slope
        (m, 19) m and (m, 19, 19) m/rad.
    rest
        (m, postures, 19) m: measured minus fitted.
    postures, crossed
        (postures, 19) rad, the measured leg's angles on both sides; (m, 19) 1 where a muscle crosses a joint.
    lower, upper
        (19,) rad, the range in which the table is used.
    """

    names: tuple[str, ...]
    nerves: tuple[str, ...]
    strength: np.ndarray
    fibre: np.ndarray
    tendon: np.ndarray
    neutral_length: np.ndarray
    pennation: np.ndarray
    constant: np.ndarray
    slope: np.ndarray
    rest: np.ndarray
    postures: np.ndarray
    crossed: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    def moment_arms(self, q=None) -> np.ndarray:
        """Moment arms at a posture, m: (..., 19, m) for angles (..., 19)."""
        angles = np.clip(angles_of(q), self.lower, self.upper)
        m, n = self.constant.shape
        arms = self.constant + (angles @ self.slope.reshape(m * n, n).T).reshape(*angles.shape[:-1], m, n)
        away = (angles[..., None, :] - self.postures) ** 2
        near = 1.0 / (away @ self.crossed.T + 1e-16)
        weight = near / (near.sum(-2, keepdims=True) + 1.0 / FADE**2)
        for p in range(len(self.postures)):
            arms += weight[..., p, :, None] * self.rest[:, p]
        return np.swapaxes(arms, -1, -2)

    def held(self, q=None) -> tuple[str, ...]:
        """What is held at the edge of the table, one sentence per joint (see `Nerves.held`)."""
        angles = angles_of(q).reshape(-1, len(JOINT_NAMES))
        inside = np.clip(angles, self.lower, self.upper)
        farthest = np.argmax(np.abs(angles - inside), axis=0)
        sentences = []
        for j in np.flatnonzero(np.abs(angles - inside).max(axis=0) > 0.0):
            asked, used = np.degrees(angles[farthest[j], j]), np.degrees(inside[farthest[j], j])
            name = JOINT_NAMES[j].replace("_", " ")
            sentences.append(f"moment arms at {name} {asked:.0f} degrees are not known: those at {used:.0f} are used")
        return tuple(sentences)

    def lengths(self, q=None) -> np.ndarray:
        """Length of muscle and tendon, m: (..., m)."""
        angles = np.clip(angles_of(q), self.lower, self.upper)
        return (
            self.neutral_length
            - angles @ self.constant.T
            - 0.5 * np.einsum("...i,mij,...j->...m", angles, self.slope, angles)
        )

    def isometric_fraction(self, q=None) -> np.ndarray:
        """Force-length factor with a rigid tendon, 1 at the optimal fibre length: (..., m)."""
        fibre = np.maximum(self.lengths(q) - self.tendon, 0.0) / np.cos(self.pennation) / self.fibre
        return np.exp(-((fibre - 1.0) ** 2) / ACTIVE_WIDTH)

    def velocity_fraction(self, q, v) -> np.ndarray:
        """Force-velocity factor (Hill), 1 when the joints stand still: (..., m); `v` (..., 19) rad/s."""
        speed = -np.einsum("...jm,...j->...m", self.moment_arms(q), angles_of(v)) / self.fibre / SHORTENING_LIMIT
        speed = np.maximum(speed, -1.0)
        shortening = (1.0 + speed) / (1.0 - np.minimum(speed, 0.0) / HILL_SHAPE)
        faster = np.maximum(speed, 0.0) * (1.0 + 1.0 / HILL_SHAPE) / (LENGTHENING_FORCE - 1.0)
        return np.where(speed < 0.0, shortening, (1.0 + LENGTHENING_FORCE * faster) / (1.0 + faster))


def fit_length(angles: np.ndarray, arms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Constant (n,) and symmetric slope (n, n) of the moment arms (postures, n) at angles (postures, n)."""
    count, n = arms.shape
    pairs = [(i, j) for i in range(n) for j in range(i, n)]
    design = np.zeros((count, n, n + len(pairs)))
    design[:, range(n), range(n)] = 1.0
    for k, (i, j) in enumerate(pairs):
        design[:, i, n + k] = angles[:, j]
        design[:, j, n + k] = angles[:, i]
    prior = np.diag(
        np.repeat([0.0, 0.02], [n, len(pairs)])
    )  # a weak pull to constant arms decides what the data does not
    rows = np.vstack([design.reshape(count * n, -1), prior])
    x = np.linalg.lstsq(rows, np.concatenate([arms.ravel(), np.zeros(len(prior))]), rcond=None)[0]
    slope = np.zeros((n, n))
    for value, (i, j) in zip(x[n:], pairs, strict=True):
        slope[i, j] = slope[j, i] = value
    return x[:n], slope


@lru_cache(maxsize=1)
def standard_muscles() -> MuscleTable:
    """The table that ships with the package (see tables/SOURCE.md), both sides."""
    rows, posture_rows, arm_rows = (read_table(f"{name}.csv") for name in ("muscles", "postures", "moment_arms"))
    labels = [label for label in posture_rows[0] if label != "joint"]
    measured = {row["joint"]: np.radians([float(row[label]) for label in labels]) for row in posture_rows}
    arms: dict[str, dict[str, np.ndarray]] = {}
    for row in arm_rows:
        values = np.array([float(row[label.replace("_deg", "_mm")]) for label in labels]) / 1e3
        arms.setdefault(row["muscle"], {})[row["joint"]] = values
    m, n, p = 2 * len(rows), len(JOINT_NAMES), len(labels)
    constant, slope, rest = np.zeros((m, n)), np.zeros((m, n, n)), np.zeros((m, p, n))
    crossed = np.zeros((m, n))
    for s, side in enumerate(SIDES):
        for k, row in enumerate(rows):
            i = s * len(rows) + k
            names = [j if j in JOINT_NAMES else f"{side}_{j}" for j in arms[row["muscle"]]]
            sign = np.array([MIRROR_SIGN.get(j, 1.0) if side == "left" else 1.0 for j in names])
            where = [JOINT_NAMES.index(j) for j in names]
            values = sign * np.array(list(arms[row["muscle"]].values())).T
            angles = np.array([measured.get(j, np.zeros(p)) for j in arms[row["muscle"]]]).T
            constant[i, where], slope[i][np.ix_(where, where)] = fit_length(angles, values)
            rest[i][:, where] = values - constant[i, where] - angles @ slope[i][np.ix_(where, where)]
            crossed[i, where] = 1.0
    spread = np.array([measured.get(j.split("_", 1)[1], np.zeros(p)) for j in JOINT_NAMES])
    column = {
        key: np.tile([float(row[key]) for row in rows], 2)
        for key in ("strength_N", "fibre_mm", "tendon_mm", "neutral_length_mm", "pennation_deg")
    }
    return MuscleTable(
        names=tuple(f"{side}_{row['muscle']}" for side in SIDES for row in rows),
        nerves=tuple(f"{side}_{row['nerve']}" for side in SIDES for row in rows),
        strength=column["strength_N"],
        fibre=column["fibre_mm"] / 1e3,
        tendon=column["tendon_mm"] / 1e3,
        neutral_length=column["neutral_length_mm"] / 1e3,
        pennation=np.radians(column["pennation_deg"]),
        constant=constant,
        slope=slope,
        rest=rest,
        postures=spread.T,
        crossed=crossed,
        lower=spread.min(1) - BEYOND,
        upper=spread.max(1) + BEYOND,
    )
