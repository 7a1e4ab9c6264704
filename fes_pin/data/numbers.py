"""Numbers that a caller gives: one clear error where they are none, or out of range."""

from __future__ import annotations

import math

from fes_pin.data.errors import InputError


def number(value: object, name: str, infinite: bool = False) -> float:
    """A value as a number.

    Parameters
    ----------
    value, name
        What was given, and as what.
    infinite
        Whether infinity is a number here.

    Raises
    ------
    InputError
        No number, or not finite.
    """
    try:
        if isinstance(value, str | bytes | bool):
            raise TypeError
        found = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"must be a number, got {value!r}", column=name) from None
    if math.isnan(found) or (math.isinf(found) and not infinite):
        raise InputError(f"must be a finite number, got {value!r}", column=name)
    return found


def positive(value: object, name: str, infinite: bool = False) -> float:
    """A number above 0.

    Raises
    ------
    InputError
        Anything else.
    """
    found = number(value, name, infinite)
    if not found > 0.0:
        raise InputError(f"must be positive, got {value!r}", column=name)
    return found


def whole(value: object, name: str, least: int = 0) -> int:
    """A whole number, at least so great.

    Raises
    ------
    InputError
        Anything else.
    """
    found = number(value, name)
    if found != int(found) or found < least:
        raise InputError(f"must be a whole number of {least} or more, got {value!r}", column=name)
    return int(found)
