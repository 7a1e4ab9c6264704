"""Inputs on the joints: torques, muscles or nerves, each a column of joint torques with bounds."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from fes_pin.body.joints import JOINT_NAMES, known_joint, names_of
from fes_pin.body.linear_body import LinearBody
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import all_known, number, numbers, positive_number, shortened
from fes_pin.data.read_only import ReadOnly


@dataclass(frozen=True, eq=False)
class Inputs(ReadOnly):
    """A set of inputs u: joint torques D = matrix @ u.

    Parameters
    ----------
    names
        One per input.
    joint_names
        Rows of `matrix`.
    matrix
        Torque per unit of input: (n_joints, n_inputs) N m.
    lower, upper
        Bounds of each input: (n_inputs,); a nerve has 0 and 1 (it only pulls), a torque minus and plus its limit.

    Raises
    ------
    InputError
        Shapes that do not fit, repeated names, unknown joints, or bounds that do not hold 0.
    """

    names: tuple[str, ...]
    joint_names: tuple[str, ...]
    matrix: np.ndarray = field(repr=False)
    lower: np.ndarray = field(repr=False)
    upper: np.ndarray = field(repr=False)

    def __post_init__(self) -> None:
        for name in ("matrix", "lower", "upper"):
            object.__setattr__(self, name, numbers(getattr(self, name), name))
        for name in ("names", "joint_names"):
            object.__setattr__(self, name, tuple(names_of(getattr(self, name))))
        shape = (len(self.joint_names), len(self.names))
        if self.matrix.shape != shape or not np.all(np.isfinite(self.matrix)):
            raise InputError(f"the input matrix must be finite and of shape {shape}, got {self.matrix.shape}")
        if len(set(map(str, self.names))) < len(self.names) or not all(isinstance(n, str) for n in self.names):
            raise InputError("an input is named twice, or by no text")
        for name in self.joint_names:
            known_joint(name)
        if self.lower.shape != shape[1:] or self.upper.shape != shape[1:]:
            raise InputError(f"bounds must have {shape[1]} values each")
        if not (np.all(self.lower <= 0.0) and np.all(self.upper >= 0.0)):
            raise InputError("the bounds of an input must hold 0")
        self._freeze()

    @classmethod
    def torques(cls, joints: Iterable[str] = JOINT_NAMES, limit_nm: float = np.inf) -> "Inputs":
        """A motor at each joint: u is its torque, N m, within plus and minus the limit.

        Raises
        ------
        InputError
            Unknown joint, or a negative limit.
        """
        names = tuple(known_joint(name) for name in names_of(joints))
        if number(limit_nm, "limit_nm", infinite=True) < 0.0:
            raise InputError(f"the torque limit must be 0 or more, got {limit_nm}", column="limit_nm")
        matrix = np.array([[float(joint == name) for name in names] for joint in JOINT_NAMES]).reshape(19, len(names))
        bound = np.full(len(names), float(limit_nm))
        return cls(names, JOINT_NAMES, matrix, -bound, bound)

    @classmethod
    def pulling(cls, names: Sequence[str], matrix, joint_names: Sequence[str] = JOINT_NAMES) -> "Inputs":
        """Muscles or nerves: u is 0 to 1, `matrix` the torque at full recruitment, N m."""
        return cls(tuple(names), tuple(joint_names), matrix, np.zeros(len(names)), np.ones(len(names)))

    @classmethod
    def of(cls, thing, linear: LinearBody) -> "Inputs":
        """Inputs from whatever names them: `Inputs`, joint names, or nerves (with `names` and `torque_matrix`).

        Raises
        ------
        InputError
            None of these.
        """
        if not isinstance(linear, LinearBody):
            raise InputError(f"must be a LinearBody, as linearize gives it, got {shortened(linear)}", column="linear")
        if isinstance(thing, Inputs):
            return thing
        if hasattr(thing, "torque_matrix") and hasattr(thing, "names"):
            posture = {**dict.fromkeys(JOINT_NAMES, 0.0), **linear.whole_posture}
            return cls.pulling(thing.names, thing.torque_matrix(posture))
        if hasattr(thing, "keys") or not isinstance(thing, Iterable):
            raise InputError("inputs must be Inputs, Nerves, or names of joints")
        return cls.torques(names_of(thing))

    @property
    def n(self) -> int:
        """Number of inputs."""
        return len(self.names)

    @property
    def price_unit(self) -> str:
        """Unit of an integral of u'u: s of recruitments, (N m)2 s of torques."""
        return "(N m)2 s" if set(self.names) <= set(JOINT_NAMES) else "s"

    def on(self, linear: LinearBody) -> np.ndarray:
        """The matrix with rows in the order of a linearized body's joints: (n, n_inputs)."""
        rows = {name: i for i, name in enumerate(self.joint_names)}
        matrix = np.zeros((linear.n, self.n))
        for i, name in enumerate(linear.joint_names):
            if name in rows:
                matrix[i] = self.matrix[rows[name]]
        return matrix

    def pushes(self, gains: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return least and largest effect of each input within its bounds, by gains (rows, n_inputs): same shape."""
        with np.errstate(invalid="ignore"):  # a gain of 0 times no bound
            ends = np.nan_to_num([gains * self.lower, gains * self.upper], nan=0.0, posinf=np.inf, neginf=-np.inf)
        return ends.min(axis=0), ends.max(axis=0)

    def select(self, names: Iterable[str]) -> "Inputs":
        """Only these inputs.

        Raises
        ------
        InputError
            A name that is not among them.
        """
        wanted = tuple(names_of(names))
        all_known(wanted, self.names, "input")
        keep = [self.names.index(name) for name in wanted]
        return Inputs(wanted, self.joint_names, self.matrix[:, keep], self.lower[keep], self.upper[keep])

    def scaled(self, factor: float) -> "Inputs":
        """All torques times a factor (strengths are known to 1.3-1.8).

        Raises
        ------
        InputError
            A factor that is not positive.
        """
        factor = positive_number(factor, "factor")
        return Inputs(self.names, self.joint_names, factor * self.matrix, self.lower, self.upper)
