"""Sharing of the ground's wrench by two feet, each with its centre of pressure on its own sole.

The whole wrench follows from the motion; what the second foot takes of it are the multipliers of the loop that the two
feet close, J g'' = 0 in A g'' - B g - C = D + J' l, linear in deviations and torques:

    l = -(J A^-1 J')^-1 J A^-1 (B g + C + D)

(R. Featherstone, Rigid Body Dynamics Algorithms, 2008, section 8.3). The first foot takes the remaining force. Where
braces hold so much that J loses rank, some of l moves no free joint, and rigid bodies do not determine that part.
The feet can then carry the body if any such share keeps both centres of pressure on their soles.
"""

import itertools

import numpy as np
import pinocchio as pin
from scipy.linalg import null_space

from fes_pin.body.ground import SecondFoot, Wrench
from fes_pin.body.linear_body import LinearBody

_RANK = 1e-9
"""Singular values below this part of the largest are rounding, as in `fes_pin.body.linear_body`."""


def share_of_second(linear: LinearBody, second: SecondFoot) -> tuple[Wrench, np.ndarray]:
    """The wrench that a second foot takes, and what of it moves no joint.

    Parameters
    ----------
    linear
        A body on both feet, with or without braces; its B and C hold what the foot bears in the posture.
    second
        From `fes_pin.body.ground.second_foot`, at the same posture.

    Returns
    -------
    wrench
        About the origin, per deviation and torque of the joints that move.
    free
        Columns that span what may be added to it, and taken off the first foot, without any joint's noticing: (6, d).
    """
    assert linear.closure is not None  # it stands on both feet
    J = linear.closure
    per_torque = -np.linalg.pinv(J @ np.linalg.solve(linear.A, J.T), rcond=_RANK, hermitian=True)
    per_torque = per_torque @ np.linalg.solve(linear.A, J.T).T
    about = np.eye(6)
    about[3:, :3] = pin.skew(second.place)
    rigid = null_space(J.T, rcond=_RANK) if J.any() else np.eye(6)
    wrench = Wrench(second.wrench, about @ per_torque @ linear.B, np.zeros((6, linear.n)), about @ per_torque)
    return wrench, about @ rigid


def without_free(rows: np.ndarray) -> np.ndarray:
    """Combinations of inequalities r + rows s <= 0 that some s satisfies if, and only if, all combinations hold.

    They are the extreme rays of y >= 0, y' rows = 0 (Farkas), found support by support: the rows are few.

    Parameters
    ----------
    rows
        How each inequality depends on what is free: (e, d).

    Returns
    -------
    combinations
        Each with 1 as its greatest weight: (k, e); the identity where nothing is free.
    """
    count, scale = len(rows), np.abs(rows).max(initial=0.0)
    if scale == 0.0:
        return np.eye(count)
    rows = np.where(np.abs(rows) > _RANK * scale, rows / scale, 0.0)
    rank = np.linalg.matrix_rank(rows, tol=_RANK)
    rays: list[np.ndarray] = []
    for size in range(1, rank + 2):
        for support in itertools.combinations(range(count), size):
            weights = null_space(rows[list(support)].T, rcond=_RANK)
            if weights.shape[1] != 1:
                continue
            weight = weights[:, 0] * np.sign(weights[np.abs(weights).argmax(), 0])
            if weight.min() > _RANK:
                ray = np.zeros(count)
                ray[list(support)] = weight / weight.max()
                rays.append(ray)
    return np.array(rays).reshape(-1, count)
