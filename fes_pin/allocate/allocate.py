"""From wanted joint torques to recruitments and pulse widths, in one call."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fes_pin.allocate.allocation import Allocation
from fes_pin.allocate.allocator import Allocator

__all__ = ["Allocator", "allocate"]


def allocate(torque, nerves, q=None, previous=None, *, solver: str = "pivot", **options) -> Allocation:
    """Pulse widths for a wanted joint torque.

    Parameters
    ----------
    torque
        Wanted joint torque, N m, by joint name (absent: 0) or (joints,).
    nerves, q
        `Nerves` and the posture, or an array (joints, n) of torque at full recruitment, N m.
    previous, solver
        See `Allocator.__call__`.
    options
        See `Allocator`.

    Raises
    ------
    InputError
        Bad input of any kind, in one line.

    Examples
    --------
    >>> from fes_pin.muscles.nerves import Nerves
    >>> print(allocate({"left_ankle_dorsiflexion": -400.0}, Nerves(["left_tibial"])))
    """
    program = allocator_for(nerves, q, options)
    return program(torque, program.at_rest if previous is None else previous, solver=solver)


RECENT: dict[Any, Allocator] = {}
"""The last programs that `allocate` made, so that the next torque of the same kind starts where the last one ended."""
KEPT = 16


def allocator_for(nerves, q, options: dict) -> Allocator:
    """The program for these moment arms and options, made anew only if it is not among the recent ones."""
    key = (frozen(nerves), frozen(q), frozen(options))
    program = RECENT.get(key)
    if program is None:
        program = Allocator(nerves, q, **options)
        while len(RECENT) >= KEPT:
            del RECENT[next(iter(RECENT))]
        RECENT[key] = program
    return program


def frozen(value):
    """What tells two arguments apart, hashable: equal values, equal keys."""
    if isinstance(value, np.ndarray):
        return value.shape, value.dtype.str, value.tobytes()
    if isinstance(value, Mapping):
        return tuple((key, frozen(value[key])) for key in sorted(value))
    if isinstance(value, (list, tuple)):
        return tuple(frozen(item) for item in value)
    return value
