"""The paper's equation (9), A Gamma'' - B Gamma - C = D, at a posture of a body.

Signs, stated here once. With Pinocchio's A(q) a + c(q, v) + g(q) = tau and U the potential energy,

    A = CRBA(q0),   B = -d g / d q = -Hessian of U,   C = -g(q0),

Gamma the small deviation from q0 and D the joint torques. An upright posture then has positive eigenvalues of A^-1 B
(it falls), a hanging limb negative ones (it swings). Passive joints add their torque to C and take their stiffness off
B. Around a moving posture (v0, a0) the same equation holds for the deviation with C = -(A a0 + c + g), B = -d(A a + c
+ g)/d q and a rate matrix, E = d c / d v: A Gamma'' + E Gamma' - B Gamma - C = D; B is then symmetric no longer.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pinocchio as pin

from fes_pin.body.build import GRAVITY, Body
from fes_pin.body.passive import Passive
from fes_pin.data.errors import InputError


@dataclass(frozen=True)
class LinearBody:
    """A body linearized at a posture; arrays over joints in the order of `joint_names`.

    Parameters
    ----------
    joint_names
        The joints that move: 19, or fewer where braces hold some.
    q
        Their angles at the posture, rad.
    A, B
        Inertia, kg m2, and minus the stiffness of gravity and tissue, N m/rad: (n, n).
    C
        Minus the joint torques that hold the posture, N m: (n,).
    E
        Torque per joint rate, N m s/rad: (n, n); zero at rest without damping.
    body, slope, braced, held
        Where it was taken: the body, the ground's (alpha, beta), the joints that braces hold and their angles, rad.
    """

    joint_names: tuple[str, ...]
    q: np.ndarray = field(repr=False)
    A: np.ndarray = field(repr=False)
    B: np.ndarray = field(repr=False)
    C: np.ndarray = field(repr=False)
    E: np.ndarray = field(repr=False)
    body: Body = field(repr=False)
    slope: tuple[float, float] = (0.0, 0.0)
    braced: tuple[str, ...] = ()
    held: dict[str, float] = field(default_factory=dict, repr=False)

    @property
    def n(self) -> int:
        """Number of joints that move."""
        return len(self.joint_names)

    @property
    def conservative(self) -> bool:
        """Whether there is neither damping nor motion: the paper's case, where A and B tell everything."""
        return not self.E.any() and np.allclose(self.B, self.B.T, rtol=0.0, atol=1e-9 * np.abs(self.B).max())

    @cached_property
    def F(self) -> np.ndarray:
        """State matrix of equation (11), X = (Gamma, Gamma'): (2n, 2n), 1/s."""
        n = self.n
        F = np.zeros((2 * n, 2 * n))
        F[:n, n:] = np.eye(n)
        F[n:, :n] = np.linalg.solve(self.A, self.B)
        F[n:, n:] = -np.linalg.solve(self.A, self.E)
        return F

    @cached_property
    def R(self) -> np.ndarray:
        """Input matrix of equation (11) for u = C + D: (2n, n)."""
        return np.vstack([np.zeros((self.n, self.n)), np.linalg.inv(self.A)])

    @property
    def holding_torque(self) -> dict[str, float]:
        """Joint torques that hold the posture (-C), N m by name."""
        return dict(zip(self.joint_names, (-self.C).tolist(), strict=True))

    @property
    def posture(self) -> dict[str, float]:
        """Angles of the joints that move, rad by name."""
        return dict(zip(self.joint_names, self.q.tolist(), strict=True))

    @property
    def whole_posture(self) -> dict[str, float]:
        """Angles of all joints, braced ones too, rad by name."""
        return {**self.held, **self.posture}

    def modes(self):
        """The n eigenpairs of A^-1 B (see `fes_pin.body.modes.modes`)."""
        from fes_pin.body.modes import modes  # noqa: PLC0415 (modes reads what is here)

        return modes(self)

    def brace(self, joints: Sequence[str]) -> LinearBody:
        """The same body with these joints locked at the posture.

        Raises
        ------
        InputError
            A joint that is not free here, or all of them.
        """
        for name in joints:
            if name not in self.joint_names:
                raise InputError(f"cannot brace {name!r}: it is not among the joints that move")
        keep = [i for i, name in enumerate(self.joint_names) if name not in set(joints)]
        if not keep:
            raise InputError("braces hold every joint: nothing is left to move")
        block = np.ix_(keep, keep)
        return LinearBody(
            joint_names=tuple(self.joint_names[i] for i in keep),
            q=self.q[keep],
            A=self.A[block],
            B=self.B[block],
            C=self.C[keep],
            E=self.E[block],
            body=self.body,
            slope=self.slope,
            braced=(*self.braced, *joints),
            held={**self.held, **{name: self.posture[name] for name in joints}},
        )

    def __str__(self) -> str:
        held = f", {len(self.braced)} joints braced" if self.braced else ""
        slope = f" on slope {self.slope}" if any(self.slope) else ""
        worst = int(np.argmax(np.abs(self.C)))
        return (
            f"Linearized {self.body}{slope}{held}: {self.n} joints; "
            f"largest torque to hold it {-self.C[worst]:+.1f} N m at {self.joint_names[worst]}"
        )


def ground_normal(slope: Sequence[float]) -> np.ndarray:
    """Unit normal of the stance foot's ground from its horizontal components (alpha, beta): (3,).

    alpha is the component forward (positive downhill ahead), beta the component to the left.

    Raises
    ------
    InputError
        Not two finite numbers, or no slope (alpha^2 + beta^2 >= 1).
    """
    try:
        alpha, beta = (float(value) for value in slope)
    except (TypeError, ValueError):
        raise InputError(f"must be two numbers (alpha, beta), got {slope!r}", column="slope") from None
    up = 1.0 - alpha**2 - beta**2
    if not up > 0.0:
        raise InputError(f"alpha^2 + beta^2 must be below 1, got ({alpha}, {beta})", column="slope")
    return np.array([alpha, beta, np.sqrt(up)])


def model_on_slope(body: Body, slope: Sequence[float], gravity: float = GRAVITY) -> pin.Model:
    """The body's model with the stance foot flat on a slope: its gravity is turned instead of the ground.

    The foot turns from level to the slope by the shortest rotation, without twist; joint angles stay what they are.
    """
    normal = ground_normal(slope)
    if not any(normal[:2]) and gravity == GRAVITY:
        return body.model
    model = pin.Model(body.model)
    model.gravity.linear = gravity * np.array([normal[0], normal[1], -normal[2]])
    return model


def linearize(
    body: Body,
    posture="neutral",
    slope: Sequence[float] = (0.0, 0.0),
    *,
    rates=None,
    accelerations=None,
    passive: Passive | None = None,
    gravity: float = GRAVITY,
    check: bool = True,
) -> LinearBody:
    """A, B and C of a body at a posture.

    Parameters
    ----------
    body
        The body.
    posture
        Name, mapping by joint name (rad) or array (19,) as `Body.angles` takes them.
    slope
        Horizontal components (alpha, beta) of the unit normal of the ground under the stance foot.
    rates, accelerations
        Of the posture, rad/s and rad/s2, by name or (19,): linearizes around a moving posture.
    passive
        Passive joints (`ElasticJoints`, `PassiveLegs`).
    gravity
        m/s2.
    check
        Whether the posture must lie within the joints' limits.

    Raises
    ------
    InputError
        Unknown posture or joint, posture outside limits, no such slope.
    """
    q = body.angles(posture, check)
    model = model_on_slope(body, slope, gravity)
    data = model.createData()
    n = model.nv
    A = pin.crba(model, data, q).copy()
    E = np.zeros((n, n))
    if rates is None and accelerations is None:
        B = -pin.computeGeneralizedGravityDerivatives(model, data, q)
        B, C = 0.5 * (B + B.T), -data.g.copy()
    else:
        v, a = body.rates(rates), body.rates(accelerations)
        dq, dv, _ = pin.computeRNEADerivatives(model, data, q, v, a)
        B, E = -dq, dv.copy()
        C = -pin.rnea(model, data, q, v, a)
    if passive is not None:
        B = B - passive.stiffness(q, body.joint_names)
        damping = passive.damping(body.joint_names)
        E = E + damping
        C = C + passive.torque(q, body.joint_names) - damping @ body.rates(rates)
    return LinearBody(body.joint_names, q, A, B, C, E, body, (float(slope[0]), float(slope[1])))


def linearize_batch(
    body: Body, postures: np.ndarray, slope: Sequence[float] = (0.0, 0.0), out=None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A, B and C at many postures at rest, without passive joints and without looking at limits.

    Parameters
    ----------
    body
        The body.
    postures
        Joint angles in the order of `body.joint_names`: (N, 19) rad.
    slope
        As in `linearize`.
    out
        Arrays to write into, as returned; 6 kB a posture are made otherwise.

    Returns
    -------
    A, B, C
        (N, 19, 19), (N, 19, 19), (N, 19).

    Raises
    ------
    InputError
        Wrong shape, or an angle that is not finite.
    """
    q = np.ascontiguousarray(postures, dtype=float)
    model = pin.Model(model_on_slope(body, slope))
    model.gravity.linear = -model.gravity.linear  # so that Pinocchio writes -g and -dg/dq, which are C and B
    n = model.nv
    if q.ndim != 2 or q.shape[1] != n or not np.all(np.isfinite(q)):
        raise InputError(f"postures must be finite angles of shape (N, {n}), got {q.shape}")
    size = len(q)
    A, B, C = out if out is not None else (np.empty((size, n, n)), np.empty((size, n, n)), np.empty((size, n)))
    if A.shape != (size, n, n) or B.shape != (size, n, n) or C.shape != (size, n):
        raise InputError(f"`out` must have the shapes ({size}, {n}, {n}), ({size}, {n}, {n}), ({size}, {n})")
    data = model.createData()
    inertia, gravity = data.M, data.g  # views of what Pinocchio writes
    crba, stiffness = pin.crba, pin.computeGeneralizedGravityDerivatives
    for posture, a, b, c in zip(q, A.transpose(0, 2, 1), B.transpose(0, 2, 1), C, strict=True):
        crba(model, data, posture)
        a[...] = inertia  # both symmetric, and laid out as Pinocchio's
        b[...] = stiffness(model, data, posture)
        c[...] = gravity
    return A, B, C


def linearize_chunks(
    body: Body, postures: np.ndarray, slope: Sequence[float] = (0.0, 0.0), size: int = 4096
) -> Iterator[tuple[slice, np.ndarray, np.ndarray, np.ndarray]]:
    """`linearize_batch` in pieces through one pair of buffers: (rows, A, B, C), valid until the next piece.

    Takes 24 MB whatever the number of postures.
    """
    n = body.model.nv
    buffers = np.empty((size, n, n)), np.empty((size, n, n)), np.empty((size, n))
    for start in range(0, len(postures), size):
        rows = slice(start, min(start + size, len(postures)))
        count = rows.stop - rows.start
        A, B, C = linearize_batch(body, postures[rows], slope, tuple(buffer[:count] for buffer in buffers))
        yield rows, A, B, C
