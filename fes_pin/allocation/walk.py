"""Allocation over a motion: another posture, so other moment arms, at every sample."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fes_pin.allocation.allocation import Allocation, AllocationSequence
from fes_pin.allocation.allocator import Allocator
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
    each
        The samples; prices are of one scale along the whole motion, the squared torque of the strongest channel in it.
    """

    matrices: np.ndarray
    each: tuple[Allocation, ...]

    def at(self, k: int) -> Allocation:
        """Sample k with its reasons in words."""
        return self.each[k]


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
    scale = float(np.einsum("kji,j,kji->ki", matrices, p.weights, matrices).max()) or 1.0  # of prices: one for all
    each: list[Allocation] = []
    before = np.zeros(p.n)
    for matrix, torque in zip(matrices, wanted, strict=True):
        program = Allocator.of_problem(replace(p, nominal=matrix, matrix=matrix, scale=scale, other=None))
        each.append(program(torque, before))
        before = each[-1].recruitment
    parts = zip(*((one.recruitment, one.pulse_width_us, one.achieved) for one in each), strict=True)
    r, widths, achieved = map(np.array, parts)
    residual = np.array([one.certificate.residual for one in each])
    return WalkAllocation(r, widths, wanted, achieved, residual, p, matrices, tuple(each))
