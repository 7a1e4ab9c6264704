"""The paper's equation (9), A Gamma'' - B Gamma - C = D, at a posture of a body.

Signs, stated here once. With Pinocchio's A(q) a + c(q, v) + g(q) = tau and U the potential energy,

    A = CRBA(q0),   B = -d g / d q = -Hessian of U,   C = -g(q0),

Gamma the small deviation from q0 and D the joint torques. An upright posture then has positive eigenvalues of A^-1 B
(it falls), a hanging limb negative ones (it swings). Passive joints add their torque to C and take their stiffness off
B. Around a moving posture (v0, a0) the same equation holds for the deviation with C = -(A a0 + c + g), B = -d(A a + c
+ g)/d q and a rate matrix, E = d c / d v: A Gamma'' + E Gamma' - B Gamma - C = D; B is then symmetric no longer.
"""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from fes_pin.body.build import GRAVITY, Body
from fes_pin.body.gait import BOTH_FEET
from fes_pin.body.ground import second_foot
from fes_pin.body.linear_body import LinearBody
from fes_pin.body.passive import Passive
from fes_pin.data.errors import InputError
from fes_pin.data.named import NamedArray
from fes_pin.data.numbers import between, numbers, shortened, truth

MOST_GRAVITY = 100.0
"""m/s2; no planet with a surface has more (ours)."""


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
    up = 1.0 - alpha * alpha - beta * beta
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
    both_feet: bool | None = None,
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
        How strongly it pulls down, m/s2; 0 to 100.
    check
        Whether the posture must lie within the joints' limits.
    both_feet
        Whether the second forefoot stands on the ground, too (see `fes_pin.body.ground.second_foot`); by default as the
        named posture has it. C is then that of joints that load both feet as the weight lies between them.

    Raises
    ------
    InputError
        Unknown posture or joint, posture outside limits, no such slope, a gravity that pulls up; a second foot that is
        not flat on the ground, or moves.
    """
    if not isinstance(body, Body):
        raise InputError(f"must be a Body, got {shortened(body)}", column="body")
    q, gravity = body.angles(posture, truth(check, "check")), between(gravity, 0.0, MOST_GRAVITY, "gravity")
    if passive is not None and not hasattr(passive, "stiffness"):
        raise InputError(f"must be ElasticJoints or PassiveLegs, got {shortened(passive)}", column="passive")
    if both_feet is not None:
        truth(both_feet, "both_feet")
    name = posture if isinstance(posture, str) else ""
    model = model_on_slope(body, slope, gravity)
    data = model.createData()
    n = model.nv
    A = pin.crba(model, data, q).copy()
    E = np.zeros((n, n))
    second = None
    if name in BOTH_FEET if both_feet is None else both_feet:
        if rates is not None or accelerations is not None:
            raise InputError("a body on both feet is linearized at rest only", column="both_feet")
        second = second_foot(body, model, q)
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
    where, closure = (float(slope[0]), float(slope[1])), None
    if second is not None:
        stiffness = 0.5 * (second.stiffness + second.stiffness.T)
        B, C, closure = B + stiffness, C + second.torque, second.closure
    return LinearBody(body.joint_names, q, A, B, C, E, body, where, closure=closure, posture_name=name, gravity=gravity)


def linearize_batch(
    body: Body, postures: np.ndarray, slope: Sequence[float] = (0.0, 0.0), out=None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A, B and C at many postures at rest, without passive joints and without looking at limits.

    Parameters
    ----------
    body
        The body.
    postures
        Joint angles, with names or in the order of `body.joint_names`: (N, 19) rad.
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
    if isinstance(postures, NamedArray) and postures.names is not None:
        postures = postures.arranged(body.joint_names)
    q = np.ascontiguousarray(numbers(postures, "postures"))
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
