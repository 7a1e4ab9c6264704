"""The paper's linear equations along a measured single support: where they hold, and which neglected term breaks them.

The torque of the full equations is A(q) a + c(q, v) + g(q); that of A G'' - B G - C = D at rest in a posture q0 is
A(q0) a + g(q0) + dg/dq (q - q0). Their difference is exactly the sum of three terms: the change of the inertia,
(A(q) - A(q0)) a; the Coriolis and centrifugal torque c(q, v); the curvature of gravity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from fes_pin.body.linearize import linearize
from fes_pin.walk.motion import Motion

TERMS = ("change of inertia", "Coriolis", "curvature of gravity")


@dataclass(frozen=True)
class AlongStride:
    """Joint torques along a single support, in the order of `joint_names`.

    Attributes
    ----------
    joint_names
        The 19.
    full
        (n, 19) N m: of the full equations, the stance forefoot fixed to the ground.
    linear
        (n, 19): of the linear ones, each sample by the posture that is nearest in time.
    neglected
        (3, n, 19): full - linear in the terms of `TERMS`; zeros where linearized about the motion itself.
    postures
        Sample numbers of the postures.
    """

    joint_names: tuple[str, ...]
    full: np.ndarray = field(repr=False)
    linear: np.ndarray = field(repr=False)
    neglected: np.ndarray = field(repr=False)
    postures: np.ndarray

    @property
    def error_percent(self) -> np.ndarray:
        """Rms of full - linear in percent of the rms of full, by joint: (19,)."""
        return 100.0 * _rms(self.full - self.linear) / np.maximum(_rms(self.full), 1e-12)


def _rms(values: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(values**2, axis=0))


def along(rooted: Motion, postures: int | Sequence[float], moving: bool = False) -> AlongStride:
    """Linear against full equations along a motion that stands on one forefoot.

    Parameters
    ----------
    rooted
        As `rooted_motion` gives it.
    postures
        How many postures to linearize at, evenly spread over the samples; or where, as shares of the stance.
    moving
        Linearize about the motion at these samples, with its rates and accelerations (the term E G' included), not at
        rest in its postures.
    """
    body, count = rooted.body, len(rooted.time)
    q, v, a = rooted.q[:, 7:], rooted.v[:, 6:], rooted.a[:, 6:]
    model, data = body.model, body.model.createData()
    shares = (np.arange(postures) + 0.5) / postures if isinstance(postures, int) else np.asarray(postures)
    at = np.clip(np.round(shares * count - 0.5), 0, count - 1).astype(int)
    nearest = at[np.argmin(np.abs(np.arange(count)[:, None] - at), axis=1)]
    full, linear, neglected = np.empty_like(q), np.empty_like(q), np.zeros((3, *q.shape))
    known = {}
    for k in at:
        state = {"rates": v[k], "accelerations": a[k]} if moving else {}
        known[k] = linearize(body, q[k], check=False, **state)
    for t in range(count):
        lin, k = known[nearest[t]], nearest[t]
        full[t] = pin.rnea(model, data, q[t], v[t], a[t])
        away = q[t] - q[k]
        if moving:
            linear[t] = lin.A @ (a[t] - a[k]) + lin.E @ (v[t] - v[k]) - lin.B @ away - lin.C
            continue
        linear[t] = lin.A @ a[t] - lin.B @ away - lin.C
        inertia = pin.crba(model, data, q[t])
        gravity = pin.computeGeneralizedGravity(model, data, q[t])
        neglected[0, t] = (inertia - lin.A) @ a[t]
        neglected[1, t] = full[t] - inertia @ a[t] - gravity
        neglected[2, t] = gravity + lin.B @ away + lin.C
    return AlongStride(tuple(body.joint_names), full, linear, neglected, at)
