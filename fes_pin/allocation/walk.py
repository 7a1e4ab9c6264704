"""Allocation over a motion: another posture, so other moment arms, at every sample."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fes_pin.allocation.allocation import Allocation, AllocationSequence
from fes_pin.allocation.bounded import solve_sequence
from fes_pin.allocation.certificate import Certifier, residuals
from fes_pin.allocation.inputs import in_range, wanted_torques
from fes_pin.allocation.problem import Options, problem_of
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import numbers


@dataclass(frozen=True, eq=False)
class WalkAllocation(AllocationSequence):
    """Allocations along a motion; `problem` has the options and the moment arms of the first sample.

    Attributes
    ----------
    matrices
        (samples, joints, n) torque at full recruitment, N m.
    scale
        (N m)^2, what prices are of along the whole motion.
    """

    matrices: np.ndarray
    scale: float

    def at(self, k: int) -> Allocation:
        """Sample k with its reasons in words."""
        p, matrix = self.problem, self.matrices[k]
        scale = float((p.weights @ matrix**2).max()) or 1.0
        same = self.scale / scale  # one scale of prices for the whole motion
        here = replace(p, matrix=matrix, nominal=matrix, scale=scale, prices=p.prices * same, change=p.change * same)
        r, wanted, before = self.recruitment[k], self.wanted[k], self.recruitment[k - 1] if k else np.zeros(p.n)
        proof, achieved, gradient = Certifier(here)(before, wanted, r, p.lower, p.upper)
        width = self.pulse_width_us[k]
        return Allocation(r, width, wanted, achieved, gradient, p.lower, p.upper, before, proof, proof.gap, here)


def allocate_walk(torques: Any, nerves: Any, q: Any, v: Any = None, **options: Any) -> WalkAllocation:
    """Allocate torques along a motion, each sample starting from the last.

    Parameters
    ----------
    torques, q, v
        (samples, joints) N m, rad, and rad/s: with names (`NamedArray`), or in the order of `JOINT_NAMES`. Without
        rates muscles pull as at rest.
    nerves
        `Nerves`, or their matrices (samples, joints, n) (then `q` is not read).
    options
        See `Allocator`; no least recruitments, cubes or lexicographic, no rate.

    Raises
    ------
    InputError
        Shapes that do not fit, numbers that are not finite, or such an option.
    """
    named = hasattr(nerves, "torque_matrix")
    matrices = np.array(nerves.torque_matrix(q, v) if named else numbers(nerves, "moment arms"), dtype=float)
    if matrices.ndim != 3 or not len(matrices):
        raise InputError(f"moment arms along a motion must be samples x joints x channels, got {matrices.shape}")
    in_range(matrices, "moment arms along the motion")
    if not named and v is not None:
        raise InputError("a velocity goes with nerves: matrices hold what muscles make at theirs")
    q0, v0 = (None if a is None or not named or np.ndim(a) < 2 else a[0] for a in (q, v))
    p = problem_of(nerves if named else matrices[0], q0, v0, Options.of(options))
    wanted = wanted_torques(torques, p.joints, other=p.other)
    if len(wanted) != len(matrices):
        raise InputError(f"torques of shape {wanted.shape} do not fit moment arms of shape {matrices.shape}")
    if not p.plain or p.rate < np.inf:
        raise InputError("least recruitments, cubes, lexicographic and rate are allocated one torque at a time")
    matrices = matrices * (p.upper > 0.0)
    weighed = np.swapaxes(matrices, 1, 2) * p.weights
    H = weighed @ matrices
    scale = float(np.einsum("kii->ki", H).max()) or 1.0
    H /= scale
    H[:, range(p.n), range(p.n)] += p.prices + p.change
    F = -np.einsum("knj,kj->kn", weighed, wanted) / scale
    r = solve_sequence(H, F, p.lower, p.upper, keep=p.change)
    achieved = np.einsum("kjn,kn->kj", matrices, r)
    before = np.vstack([np.zeros(p.n), r[:-1]])
    gradient = np.einsum("knj,kj->kn", weighed, achieved - wanted) / scale + p.prices * r + p.change * (r - before)
    curvature = np.einsum("kii->ki", H)
    residual = np.maximum.reduce(residuals(gradient, r, p.lower, p.upper, curvature)[:3])
    return WalkAllocation(r, p.curves.pulse_width_us(r), wanted, achieved, residual, p, matrices, scale)
