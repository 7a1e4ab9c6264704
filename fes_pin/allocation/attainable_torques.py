"""The joint torques that a set of nerves can make at a posture: sums of one-sided columns, a zonotope."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import linprog, lsq_linear

from fes_pin.allocation.inputs import fractions, torque_matrix, wanted_torque
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import all_known, by_name, shortened
from fes_pin.data.show import DataFrame, frame, table_html

INSIDE_NM = 1e-6
"""A torque nearer to the set than this counts as inside, N m."""


@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """The attainable torque nearest to a wanted one.

    Attributes
    ----------
    torque, recruitment
        (joints,) N m and (n,), one that makes it.
    distance
        Euclidean distance from the wanted torque over the joints that count, N m.
    """

    torque: np.ndarray
    recruitment: np.ndarray
    distance: float

    @property
    def inside(self) -> bool:
        """Whether the wanted torque is attainable."""
        return self.distance <= INSIDE_NM


class AttainableTorques:
    """All torques `R r`, 0 <= r <= upper, seen on the joints that count.

    Parameters
    ----------
    nerves, q
        `Nerves` and the posture, or an array (joints, n).
    joints
        Names of the joints that count; all by default.
    upper
        Greatest recruitment, 0 to 1, by name or (n,).

    Raises
    ------
    InputError
        No joint, an unknown or repeated one, a limit that is none, or a matrix that is not finite or out of any body's
        range.
    """

    def __init__(self, nerves: Any, q: Any = None, joints: Iterable[str] | None = None, upper: Any = 1.0) -> None:
        whole, names, known = torque_matrix(nerves, q)
        several: Any = known if joints is None else joints
        one = isinstance(joints, str) or not isinstance(several, Iterable)
        self.joints: tuple[str, ...] = (several,) if one else tuple(several)
        all_known(self.joints, known, "joint")
        if not self.joints or len(set(self.joints)) < len(self.joints):
            raise InputError(f"joints must be different names, one or more, got {shortened(self.joints)}")
        self.names, self.upper = names, fractions(upper, names, "upper limits", 1.0)
        self.columns = whole[[known.index(name) for name in self.joints]] * self.upper
        for array in (self.upper, self.columns):
            array.setflags(write=False)

    def support(self, direction: Any) -> float:
        """Greatest component of attainable torque along a direction (by joint name or array), times its length, N m."""
        return float(np.maximum(by_name(direction, self.joints, "direction", 0.0) @ self.columns, 0.0).sum())

    def range(self, joint: str) -> tuple[float, float]:
        """Least and greatest torque of one joint, whatever the others do, N m."""
        return -self.support({joint: -1.0}), self.support({joint: 1.0})

    def to_frame(self) -> DataFrame:
        """Least and greatest torque, N m, a row each joint, as a frame of pandas; see `data.show.frame`."""
        least, greatest = zip(*map(self.range, self.joints), strict=True)
        return frame({"joint": self.joints, "least": least, "greatest": greatest}, "joint")

    def _repr_html_(self) -> str:
        rows = [(joint, "{:.1f} to {:.1f} N m".format(*self.range(joint))) for joint in self.joints]
        return table_html(f"Attainable by {len(self.names)} channels", ("joint", "torque"), rows)

    def nearest(self, torque: Any) -> Nearest:
        """The attainable torque nearest to one wanted (by joint name, absent 0, or array over those that count)."""
        wanted = wanted_torque(torque, self.joints)
        r = lsq_linear(self.columns, wanted, (0.0, 1.0), method="bvls", tol=1e-15).x
        return Nearest(self.columns @ r, r * self.upper, float(np.linalg.norm(self.columns @ r - wanted)))

    def contains(self, torque: Any) -> bool:
        """Return whether the torque is attainable, to 1e-6 N m."""
        return self.nearest(torque).inside

    def share(self, torque: Any) -> float:
        """Greatest multiple of the torque that is attainable, infinite for no torque (a linear program)."""
        wanted = wanted_torque(torque, self.joints)
        if not wanted.any():
            return np.inf
        n, size = self.columns.shape[1], float(np.abs(wanted).max())
        equal = np.column_stack([self.columns, -wanted / size])
        bounds = [(0, 1)] * n + [(0, None)]
        result = linprog(np.r_[np.zeros(n), -1.0], A_eq=equal, b_eq=np.zeros(len(wanted)), bounds=bounds)
        return float(result.x[-1] / size) if result.success else 0.0

    def outline(self, first: str, second: str) -> np.ndarray:
        """Corners of the set seen on two joints, counter-clockwise, (corners, 2) N m: what to draw."""
        index = [self.joints.index(name) if name in self.joints else -1 for name in (first, second)]
        if -1 in index:
            raise InputError(f"{first} and {second} must be among {', '.join(self.joints)}")
        columns = self.columns[index].T
        columns = columns[(columns != 0.0).any(1)]
        if not len(columns):
            return np.zeros((1, 2))
        upward = np.where((columns[:, 1] < 0.0) | ((columns[:, 1] == 0.0) & (columns[:, 0] < 0.0)), -1.0, 1.0)
        edges = columns * upward[:, None]
        edges = edges[np.argsort(np.arctan2(edges[:, 1], edges[:, 0]))]
        lowest = columns[upward < 0.0].sum(0)
        path = lowest + np.vstack([np.zeros(2), np.cumsum(edges, 0)])
        return np.vstack([path, path[-1] + lowest - path[1:-1]])
