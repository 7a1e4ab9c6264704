"""Passive torques of unstimulated joints: springs and dampers given by name, or the measured legs of Riener and Edrich.

Every class here answers `torque(q, names)`, `stiffness(q, names)` = -d torque / d q, symmetric, and `damping(names)`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np

from fes_pin.body.joints import JOINT_NAMES, SIDES, angles_array
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import between
from fes_pin.data.read_only import ReadOnly
from fes_pin.data.table import own_table


class Passive(Protocol):
    """The interface of passive joints to the linearization."""

    def torque(self, q: np.ndarray, names: Sequence[str]) -> np.ndarray:
        """Passive torque at rest: (19,) N m."""

    def stiffness(self, q: np.ndarray, names: Sequence[str]) -> np.ndarray:
        """Minus its derivative, symmetric: (19, 19) N m/rad."""

    def damping(self, names: Sequence[str]) -> np.ndarray:
        """Diagonal damping: (19, 19) N m s/rad."""


def _positive(values: Mapping[str, float], names: Sequence[str], what: str) -> np.ndarray:
    array = angles_array(values, names)
    if (array < 0.0).any():
        raise InputError(f"{what} of {names[int(np.argmin(array))]} must not be negative")
    return array


@dataclass(frozen=True, eq=False)
class ElasticJoints(ReadOnly):
    """A spring and a damper in each joint: tau = -stiffness (q - rest) - damping v.

    Parameters
    ----------
    stiffness_nm, damping_nms, rest_rad
        By joint name: N m/rad, N m s/rad, rad; joints left out have 0.

    Raises
    ------
    InputError
        Unknown joint, negative stiffness or damping.
    """

    stiffness_nm: Mapping[str, float] = field(default_factory=dict)
    damping_nms: Mapping[str, float] = field(default_factory=dict)
    rest_rad: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _positive(self.stiffness_nm, JOINT_NAMES, "stiffness")
        _positive(self.damping_nms, JOINT_NAMES, "damping")
        angles_array(self.rest_rad, JOINT_NAMES)
        self._freeze()

    def torque(self, q: np.ndarray, names: Sequence[str]) -> np.ndarray:
        """Torque at rest: (19,) N m."""
        return -_positive(self.stiffness_nm, names, "stiffness") * (q - angles_array(self.rest_rad, names))

    def stiffness(self, q: np.ndarray, names: Sequence[str]) -> np.ndarray:
        """Diagonal stiffness: (19, 19) N m/rad."""
        return np.diag(_positive(self.stiffness_nm, names, "stiffness"))

    def damping(self, names: Sequence[str]) -> np.ndarray:
        """Diagonal damping: (19, 19) N m s/rad."""
        return np.diag(_positive(self.damping_nms, names, "damping"))


_NUMBERS = ("sign", "constant", "hip", "knee", "ankle")
_ROWS = own_table(Path(__file__).with_name("passive_legs.csv"))
_TERMS = [(row["joint"], [float(row[n]) for n in _NUMBERS]) for row in _ROWS]
_OFFSETS = {"hip_flexion": 8.072, "knee_flexion": -4.820, "ankle_dorsiflexion": 1.792}
_DEGREE = 180.0 / np.pi
MOST_PASSIVE = 100.0
"""Limit of stiffness, in multiples of a healthy leg's (ours): contractures are a few times as stiff."""


@dataclass(frozen=True, eq=False)
class PassiveLegs(ReadOnly):
    """Passive elastic moments of hip, knee and ankle in the sagittal plane, with the coupling of two-joint muscles.

    Sums of exponentials fitted to ten healthy adults: R. Riener, T. Edrich, "Identification of passive elastic joint
    moments in the lower extremities", J. Biomech. 32:539-544, 1999 (coefficients compared with public code that cites
    it; the article was not at hand). Paralysed legs differ: scale them with `factor`. The fitted moments are not the
    gradient of a potential; `stiffness` is the symmetric part of their derivative, so that B stays symmetric.

    Parameters
    ----------
    factor
        On all moments.
    damping_nms
        Damping by joint name, N m s/rad; none by default.

    Raises
    ------
    InputError
        A factor that is not between 0 and 100, unknown joint, negative damping.
    """

    factor: float = 1.0
    damping_nms: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "factor", between(self.factor, 0.0, MOST_PASSIVE, "factor"))
        _positive(self.damping_nms, JOINT_NAMES, "damping")
        self._freeze()

    def _each(self, q: np.ndarray, names: Sequence[str]):
        places = {name: i for i, name in enumerate(names)}
        for side in SIDES:
            at = [places[f"{side}_{joint}"] for joint in ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")]
            angles = q[at] * [_DEGREE, _DEGREE, -_DEGREE]
            for joint, (sign, constant, *weights) in _TERMS:
                moment = self.factor * sign * np.exp(constant + np.dot(weights, angles))
                yield places[f"{side}_{joint}"], at, moment, moment * np.array(weights) * [_DEGREE, _DEGREE, -_DEGREE]

    def torque(self, q: np.ndarray, names: Sequence[str]) -> np.ndarray:
        """Moments at rest: (19,) N m."""
        tau = np.zeros(len(names))
        for i, _, moment, _ in self._each(q, names):
            tau[i] += moment
        for side in SIDES:
            for joint, offset in _OFFSETS.items():
                tau[list(names).index(f"{side}_{joint}")] += self.factor * offset
        return tau

    def stiffness(self, q: np.ndarray, names: Sequence[str]) -> np.ndarray:
        """Symmetric part of the stiffness: (19, 19) N m/rad."""
        slope = np.zeros((len(names), len(names)))
        for i, at, _, derivative in self._each(q, names):
            slope[i, at] -= derivative
        return 0.5 * (slope + slope.T)

    def damping(self, names: Sequence[str]) -> np.ndarray:
        """Diagonal damping: (19, 19) N m s/rad."""
        return np.diag(_positive(self.damping_nms, names, "damping"))
