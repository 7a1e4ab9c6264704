"""A body linearized at a posture: A, B, C, E of its joints, braces, and further feet that stand on the ground.

Two feet on the ground close a loop: the joints' deviations g obey J g = 0, J the Jacobian of the second foot
(`closure`). They then lie in the span of `basis`, and accelerations are `mobility` times torques; on one foot the two
are the identity and A^-1.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import eigh, null_space

from fes_pin.body.build import GRAVITY, Body
from fes_pin.body.joints import names_of
from fes_pin.body.modes import Mode, ModeSet, mode_name
from fes_pin.data.errors import InputError
from fes_pin.data.named import NamedArray
from fes_pin.data.numbers import known_word
from fes_pin.data.read_only import held
from fes_pin.data.show import DataFrame, Tabulated, frame

_RANK = 1e-9
"""Singular values below this part of the largest are rounding: the second foot's rows are of order 1."""


@dataclass(frozen=True, eq=False)
class LinearBody(Tabulated):
    """A body linearized at a posture; arrays over joints in the order of `joint_names`.

    Vectors answer by name, as in `linear.C["right_hip_flexion"]`, matrices as tables: `linear.to_frame("A")`.

    Parameters
    ----------
    joint_names
        The joints that move: 19, or fewer where braces hold some.
    q
        Their angles at the posture, rad: (n,).
    A, B
        Inertia, kg m2, and minus the stiffness of gravity and tissue, N m/rad: (n, n).
    C
        Minus the joint torques that hold the posture, N m: (n,).
    E
        Torque per joint rate, N m s/rad: (n, n); zero at rest without damping.
    body, slope, braced, held
        Where it was taken: the body, the ground's (alpha, beta), the joints that braces hold and their angles, rad.
    closure
        What a second foot on the ground holds: (c, n) rows that deviations are orthogonal to; none on one foot.
    posture_name, gravity
        The posture's name, if it has one; m/s2.
    """

    joint_names: tuple[str, ...]
    q: NamedArray = field(repr=False)
    A: np.ndarray = field(repr=False)
    B: np.ndarray = field(repr=False)
    C: NamedArray = field(repr=False)
    E: np.ndarray = field(repr=False)
    body: Body = field(repr=False)
    slope: tuple[float, float] = (0.0, 0.0)
    braced: tuple[str, ...] = ()
    held: Mapping[str, float] = field(default_factory=dict, repr=False)
    closure: np.ndarray | None = field(default=None, repr=False)
    posture_name: str = ""
    gravity: float = GRAVITY

    def __post_init__(self) -> None:
        for name in ("q", "C"):
            object.__setattr__(self, name, NamedArray(getattr(self, name), self.joint_names))
        self._freeze()

    @property
    def n(self) -> int:
        """Number of joints that move."""
        return len(self.joint_names)

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the states of equation (11), in the order of `F`: the joints, then their rates."""
        return (*self.joint_names, *(f"{name}_rate" for name in self.joint_names))

    @property
    def both_feet(self) -> bool:
        """Whether the second foot stands on the ground, too."""
        return self.closure is not None

    @cached_property
    def basis(self) -> np.ndarray:
        """Columns that span the deviations that the ground allows: (n, r), orthonormal."""
        return held(np.eye(self.n) if self.closure is None else null_space(self.closure, rcond=_RANK))

    @cached_property
    def mobility(self) -> np.ndarray:
        """Acceleration of each joint per torque at each: (n, n), 1/(kg m2); A^-1 on one foot."""
        return held(self.basis @ np.linalg.solve(self.basis.T @ self.A @ self.basis, self.basis.T))

    @property
    def conservative(self) -> bool:
        """Whether there is neither damping nor motion: the paper's case, where A and B describe the body."""
        return not self.E.any() and np.allclose(self.B, self.B.T, rtol=0.0, atol=1e-9 * np.abs(self.B).max())

    @cached_property
    def F(self) -> np.ndarray:
        """State matrix of equation (11), X = (Gamma, Gamma'): (2n, 2n), 1/s."""
        n = self.n
        F = np.zeros((2 * n, 2 * n))
        F[:n, n:] = np.eye(n)
        F[n:, :n] = self.mobility @ self.B
        F[n:, n:] = -self.mobility @ self.E
        return held(F)

    @cached_property
    def R(self) -> np.ndarray:
        """Input matrix of equation (11) for u = C + D: (2n, n)."""
        return held(np.vstack([np.zeros((self.n, self.n)), self.mobility]))

    @property
    def holding_torque(self) -> dict[str, float]:
        """Joint torques that hold the posture (-C), N m by name."""
        return {name: -float(value) for name, value in self.C.items()}

    @property
    def posture(self) -> dict[str, float]:
        """Angles of the joints that move, rad by name."""
        return {name: float(value) for name, value in self.q.items()}

    @property
    def whole_posture(self) -> dict[str, float]:
        """Angles of all joints, braced ones too, rad by name."""
        return {**self.held, **self.posture}

    _index = "joint"

    def _table(self) -> dict[str, Any]:
        return {"joint": list(self.joint_names), "angle_rad": self.q.tolist(), "holding_nm": (-self.C).tolist()}

    def to_frame(self, matrix: str | None = None) -> DataFrame:
        """Angles and holding torques by joint as a frame of pandas, or one of the matrices with its names.

        Parameters
        ----------
        matrix
            `A`, `B` or `E`, by joint; `F`, by state; `R`, states by joint.

        Raises
        ------
        InputError
            Another matrix; pandas is not installed.
        """
        if matrix is None:
            return super().to_frame()
        known_word(matrix, ("A", "B", "E", "F", "R"), "matrix")
        rows = self.state_names if matrix in "FR" else self.joint_names
        columns = self.state_names if matrix == "F" else self.joint_names
        values = dict(zip(columns, getattr(self, matrix).T, strict=True))
        return frame({"name": list(rows), **values}, index="name")

    def modes(self) -> ModeSet:
        """The eigenpairs of A^-1 B with names, n of them on one foot (see `fes_pin.body.modes`).

        Damping and rates are left out (with them see `poles`); of a B that is not symmetric (moving posture) the
        symmetric part is taken.
        """
        N, B = self.basis, 0.5 * (self.B + self.B.T)
        values, reduced = eigh(N.T @ B @ N, N.T @ self.A @ N)
        values, shapes = values[::-1], N @ reduced[:, ::-1]
        signs = np.sign(shapes[np.abs(shapes).argmax(axis=0), np.arange(len(values))])
        shapes = shapes * signs
        shares = np.abs(shapes * (self.A @ shapes))
        shares /= shares.sum(axis=0)
        names, stance = self.joint_names, self.body.stance
        each = zip(values.tolist(), shapes.T, shares.T, strict=True)
        named = tuple(Mode(v, shape, names, share, mode_name(v, share, names, stance)) for v, shape, share in each)
        return ModeSet(named, values, shapes, self.conservative)

    def poles(self) -> np.ndarray:
        """The 2r eigenvalues of F with damping and rates, 1/s, fastest growing first; r = n on one foot."""
        if self.conservative:
            roots = np.emath.sqrt(self.modes().values).astype(complex)
            values = np.concatenate([roots, -roots])
        else:
            N, r = self.basis, self.basis.shape[1]
            inertia = N.T @ self.A @ N
            rates = np.linalg.solve(inertia, np.hstack([N.T @ self.B @ N, -N.T @ self.E @ N]))
            values = np.linalg.eigvals(np.vstack([np.eye(r, 2 * r, r), rates]))
        return values[np.lexsort((values.imag, -values.real))]

    def brace(self, joints: str | Iterable[str]) -> "LinearBody":
        """The same body with these joints locked at the posture: names, or one name.

        Raises
        ------
        InputError
            A joint that is not free here, or all of them.
        """
        joints = names_of(joints)
        for name in joints:
            if name not in self.joint_names:
                raise InputError(f"cannot brace {name!r}: it is not among the joints that move")
        keep = [i for i, name in enumerate(self.joint_names) if name not in set(joints)]
        if not keep:
            raise InputError("braces hold every joint: nothing is left to move")
        block = np.ix_(keep, keep)
        braced = replace(
            self,
            joint_names=tuple(self.joint_names[i] for i in keep),
            q=self.q[keep],
            A=self.A[block],
            B=self.B[block],
            C=self.C[keep],
            E=self.E[block],
            braced=(*self.braced, *joints),
            held={**self.held, **{name: self.posture[name] for name in joints}},
            closure=None if self.closure is None else self.closure[:, keep],
        )
        if braced.both_feet and not braced.basis.shape[1]:
            raise InputError("braces and the ground hold every joint: nothing is left to move")
        return braced

    def __str__(self) -> str:
        held = f", {len(self.braced)} joints braced" if self.braced else ""
        slope = f" on slope {self.slope}" if any(self.slope) else ""
        if self.both_feet:
            return f"Linearized {self.body}, both feet on the ground{slope}{held}: {self.n} joints"
        worst = int(np.argmax(np.abs(self.C)))
        largest = f"{-self.C[worst]:+.1f} N m at {self.joint_names[worst]}"
        return f"Linearized {self.body}{slope}{held}: {self.n} joints; largest torque to hold it {largest}"
