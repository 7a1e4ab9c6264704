"""Checks of given torques and torque matrices; numbers that no body makes are input errors."""

from typing import Any

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import by_name, numbers

LARGEST_NM, SMALLEST_NM = 1e4, 1e-6
"""No joint of any body makes more: the strongest people's hips extend with some hundred N m (Anderson, Madigan and
Nussbaum 2007, J. Biomech. 40:3105-3113). Where the strongest channel makes less, units are mistaken."""

ROUNDED = 1e-9
"""Recruitments that a caller computed may exceed 0 to 1 by so much."""


def torque_matrix(nerves: Any, q: Any, v: Any = None) -> tuple[np.ndarray, tuple[str, ...], tuple[str, ...]]:
    """Torque at full recruitment, (joints, n) N m, names of channels and of joints: of `Nerves` (posture, rates), of a
    DataFrame (joints x channels), or of an array, whose joints and channels are numbered.

    Raises
    ------
    InputError
        Not such a matrix of finite numbers, or numbers out of any body's range.
    """
    if hasattr(nerves, "torque_matrix"):
        names, joints = tuple(nerves.names), tuple(nerves.joints)
        matrix = np.array(nerves.torque_matrix(q, v), dtype=float)
    else:
        if v is not None:
            raise InputError("a velocity goes with nerves: a torque matrix holds what muscles make at theirs")
        matrix = np.atleast_2d(numbers(nerves, "the torque matrix"))
        if hasattr(nerves, "columns"):
            names, joints = tuple(map(str, nerves.columns)), tuple(map(str, nerves.index))
        else:
            names = tuple(f"channel_{i + 1}" for i in range(matrix.shape[-1]))
            joints = tuple(f"joint_{j + 1}" for j in range(len(matrix)))
    if matrix.ndim != 2 or 0 in matrix.shape:
        raise InputError(f"the torque matrix must be joints x channels, got shape {matrix.shape}")
    if len(set(names)) < len(names) or len(set(joints)) < len(joints):
        raise InputError("the torque matrix names a channel or a joint twice")
    in_range(matrix, "the torque matrix")
    return matrix, names, joints


def in_range(matrix: np.ndarray, what: str) -> None:
    """Refuse torques at full recruitment, N m, that no body makes.

    Raises
    ------
    InputError
        Not finite, beyond 1e4 N m, or all below 1e-6 N m but not zero.
    """
    if not np.isfinite(matrix).all():
        raise InputError(f"{what} holds a number that is not finite")
    most = float(np.abs(matrix).max(initial=0.0))
    if most > LARGEST_NM:
        raise InputError(f"{what} holds {most:g} N m; no muscle of any body makes more than {LARGEST_NM:g}")
    if 0.0 < most < SMALLEST_NM:
        raise InputError(f"the strongest channel of {what} makes {most:g} N m, less than {SMALLEST_NM:g}: wrong units?")


def has_names(torque: Any, joints: tuple[str, ...], other: tuple[str, ...] | None) -> bool:
    """Whether torques come by name; `other` is the order of a labelled posture, which arrays must then not be taken in.

    Raises
    ------
    InputError
        An array without names together with a posture in another order.
    """
    if hasattr(torque, "keys"):
        return True
    if other is not None and np.ndim(torque) and len(joints) > 1:
        order = f"begins at {other[0]}, that of arrays without names at {joints[0]}"
        raise InputError(f"the order of the posture {order}: give torques by name, or as NamedArray(torques, names)")
    return False


def wanted_torque(torque: Any, joints: tuple[str, ...], other: tuple[str, ...] | None = None) -> np.ndarray:
    """A wanted torque, by name (absent joints: 0) or (joints,) in the order of `joints`, as an array, N m.

    Raises
    ------
    InputError
        Not such numbers, one number for several joints, beyond any body's range, or see `has_names`.
    """
    if not has_names(torque, joints, other) and len(joints) > 1 and np.ndim(torque) == 0:
        raise InputError(f"one torque for {len(joints)} joints: name its joint, as in {{{joints[0]!r}: -40}}")
    wanted = by_name(torque, joints, "wanted torque", 0.0)
    worst = int(np.abs(wanted).argmax())
    if abs(wanted[worst]) > LARGEST_NM:
        raise InputError(f"wanted torque of {joints[worst]} is {wanted[worst]:g} N m, beyond {LARGEST_NM:g}")
    return wanted


def fractions(values: Any, names: tuple[str, ...], what: str, default: float = 0.0) -> np.ndarray:
    """Recruitments or limits of them, by name, one for all or (n,), as an array.

    Raises
    ------
    InputError
        Not such numbers, or not within 0 and 1: pulse widths are none.
    """
    found = by_name(values, names, what, default)
    inside = np.clip(found, 0.0, 1.0)
    wrong = np.abs(found - inside) > ROUNDED
    if wrong.any():
        i = int(np.argmax(wrong))
        must = "must lie between 0 and 1 (a recruitment, not a pulse width)"
        raise InputError(f"{what} of {names[i]} {must}, got {found[i]:g}")
    return inside


def wanted_torques(
    torques: Any, joints: tuple[str, ...], what: str = "samples", other: tuple[str, ...] | None = None
) -> np.ndarray:
    """Wanted torques over time, (samples, joints) N m: columns by name (mapping, DataFrame, `NamedArray`; absent joints
    get 0), or an array whose columns are in the order of `joints`.

    Raises
    ------
    InputError
        Not such numbers, beyond any body's range, or see `has_names`.
    """
    if has_names(torques, joints, other):
        columns = dict(torques.items())
        by_name(dict.fromkeys(columns, 0.0), joints, "wanted torques", 0.0)
        given = numbers(list(columns.values()), "wanted torques")
        if given.ndim != 2:
            raise InputError(f"wanted torques by name must be {what} each, got an array of shape {given.shape}")
        torques = np.zeros((given.shape[1], len(joints)))
        torques[:, [joints.index(name) for name in columns]] = given.T
    wanted = numbers(torques, "wanted torques")
    if wanted.ndim != 2 or wanted.shape[1] != len(joints):
        raise InputError(f"torques must be {what} x {len(joints)}, got shape {wanted.shape}")
    if not np.abs(wanted).max(initial=0.0) <= LARGEST_NM:
        k, j = np.argwhere(~(np.abs(wanted) <= LARGEST_NM))[0]
        must = f"not a finite number within {LARGEST_NM:g} N m"
        raise InputError(f"wanted torque of {joints[j]} at sample {k} is {wanted[k, j]:g}, {must}")
    return wanted
