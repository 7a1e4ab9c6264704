"""Numbers that a caller gives: one clear error where they are none, or out of range."""

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from numbers import Real
from types import UnionType
from typing import Any, TypeVar

import numpy as np

from fes_pin.data.errors import InputError

_Value = TypeVar("_Value")


def instance(value: _Value, kind: type | UnionType, name: str, how: str = "") -> _Value:
    """A value of a type.

    Parameters
    ----------
    value, kind, name
        What was given, what it must be, and as what it was given.
    how
        What to do instead.

    Raises
    ------
    InputError
        Anything else.
    """
    if not isinstance(value, kind):
        message = f"expected a {getattr(kind, '__name__', kind)}, found a {type(value).__name__}{how}"
        raise InputError(message, column=name)
    return value


def as_number(value: object) -> float | None:
    """A number as a float, infinite where it is too large for one; None for what is no number: text, True, several."""
    if type(value) is float:
        return value
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    if not isinstance(value, Real) or isinstance(value, bool | np.bool_):
        return None
    try:
        return float(value)
    except OverflowError:
        return math.inf


def number_in(text: str, error: Callable[[str], Exception] = ValueError) -> float:
    """The number that a text says, written as in files of numbers: without underscores.

    Raises
    ------
    Exception
        What `error` makes of a message, for a text that says none.
    """
    try:
        return float("" if "_" in text else text)
    except ValueError:
        raise error(f"expected a number, found {text[:40]!r}") from None


def in_full(*values: float) -> str:
    """Numbers as files hold them, apart by blanks: as many digits as give them back, whatever type of number they are.

    Everything that writes numbers into URDF or TOML calls it: `repr` of a numpy number is no number there.
    """
    return " ".join(repr(float(value)) for value in values)


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
    found = as_number(value)
    if found is None:
        raise InputError(f"must be a number, got {shortened(value)}", column=name)
    if math.isnan(found) or (math.isinf(found) and not infinite):
        raise InputError(f"must be a finite number, got {shortened(value)}", column=name)
    return found


def between(value: object, low: float, high: float, name: str) -> float:
    """A number no less than one and no more than another, which may be infinite.

    Raises
    ------
    InputError
        Anything else.
    """
    found = number(value, name, infinite=math.isinf(high))
    if not low <= found <= high:
        raise InputError(f"must lie between {low:g} and {high:g}, got {found:g}", column=name)
    return found


def positive_number(value: object, name: str, infinite: bool = False) -> float:
    """A number above 0.

    Raises
    ------
    InputError
        Anything else.
    """
    found = number(value, name, infinite)
    if not found > 0.0:
        raise InputError(f"must be positive, got {shortened(value)}", column=name)
    return found


def whole(value: object, name: str, least: int = 0, most: float = math.inf) -> int:
    """A whole number, at least so great and at most so great.

    Raises
    ------
    InputError
        Anything else.
    """
    found = number(value, name)
    if found != int(found) or not least <= found <= most:
        ends = f"of {least} or more" if math.isinf(most) else f"of {least} to {most:g}"
        raise InputError(f"must be a whole number {ends}, got {shortened(value)}", column=name)
    return int(found)


def numbers(values: Any, name: str) -> np.ndarray:
    """Values as an array of numbers.

    Raises
    ------
    InputError
        Text, or lists of different lengths.
    """
    try:
        return np.array(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise InputError("must be numbers in rows of one length", column=name) from None


def known_word(value: object, allowed: Collection[str], name: str) -> str:
    """One of some words.

    Raises
    ------
    InputError
        Anything else.
    """
    if not isinstance(value, str) or value not in allowed:
        words = [repr(word) for word in allowed]
        some = f"{', '.join(words[:-1])} or {words[-1]}" if words[1:] else words[0]
        raise InputError(f"must be {some}, got {shortened(value)}", column=name)
    return value


def all_known(names: Iterable[object], known: Collection[str], what: str) -> None:
    """Refuse names that are none of those known.

    Raises
    ------
    InputError
        The first of them, with what is known.
    """
    for name in names:
        if not isinstance(name, str) or name not in known:
            raise InputError(f"unknown {what} {name!r:.40}; there are {', '.join(known)}")


def truth(value: object, name: str) -> bool:
    """True or False.

    Raises
    ------
    InputError
        Anything else: a text is no answer.
    """
    if not isinstance(value, bool | np.bool_):
        raise InputError(f"must be True or False, got {shortened(value)}", column=name)
    return bool(value)


def by_name(values: Any, names: Sequence[str], what: str, default: float) -> np.ndarray:
    """Numbers per name: a mapping or a `NamedArray` (absent names get the default), one number for all, or an array.

    Raises
    ------
    InputError
        Unknown name, wrong length, or not a finite number.
    """
    if hasattr(values, "keys"):
        values = dict(values)
        if unknown := [key for key in values if key not in names]:
            raise InputError(f"{what} names {unknown[0]!r}, which is not one of {', '.join(names)}")
        values = [values.get(name, default) for name in names]
    array = numbers(values, what)
    if array.ndim == 0:
        array = np.full(len(names), float(array))
    if array.shape != (len(names),):
        raise InputError(f"{what} must have {len(names)} numbers, got an array of shape {array.shape}")
    if not np.isfinite(array).all():
        raise InputError(f"{what} of {names[int(np.argmax(~np.isfinite(array)))]} is not a finite number")
    return array


def shortened(value: object) -> str:
    """A value as it is shown in an error: 40 characters at most."""
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
