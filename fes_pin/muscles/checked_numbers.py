"""Numbers by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fes_pin.data.errors import InputError


def number(value, low: float, high: float, what: str) -> float:
    """A number between two others.

    Raises
    ------
    InputError
        It is none, or not between them.
    """
    try:
        result = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{what} must be a number, got {str(value)[:40]!r}") from None
    if not low <= result <= high:
        raise InputError(f"{what} must lie between {low:g} and {high:g}, got {result:g}")
    return result


def by_name(values, names: Sequence[str], what: str, default: float) -> np.ndarray:
    """Numbers per name, from a mapping (absent names get the default), one number for all, or an array.

    Raises
    ------
    InputError
        Unknown name, wrong length, or not a finite number.
    """
    if isinstance(values, Mapping):
        unknown = [key for key in values if key not in names]
        if unknown:
            raise InputError(f"{what} names {unknown[0]!r}, which is not one of {', '.join(names)}")
        values = [values.get(name, default) for name in names]
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{what} must be numbers") from None
    if array.ndim == 0:
        array = np.full(len(names), float(array))
    if array.shape != (len(names),):
        raise InputError(f"{what} must have {len(names)} numbers, got an array of shape {array.shape}")
    if not np.isfinite(array).all():
        raise InputError(f"{what} of {names[int(np.argmax(~np.isfinite(array)))]} is not a finite number")
    return array
