"""Frozen dataclasses whose mappings and arrays cannot be changed either, compared and hashed by what they hold."""

import math
from collections.abc import Mapping, Set
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False, repr=False)
class ReadOnly:
    """Base of a frozen dataclass: its mappings, lists and arrays are read-only, also in copies and after pickling.

    With `eq=False` two are equal if they are of one type and all that they hold is equal, arrays and mappings too.
    """

    def __post_init__(self) -> None:
        self._freeze()

    def _freeze(self) -> None:
        """Make what is held read-only; called when the object is built and when a copy of it is."""
        for name, value in list(vars(self).items()):
            vars(self)[name] = held(value)

    def __getstate__(self) -> dict[str, Any]:
        return {n: as_dicts(v) for n, v in vars(self).items()}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        vars(self).update(state)
        self._freeze()

    def __eq__(self, other: object) -> bool:
        return self is other or (key_of(self) == key_of(other) if type(other) is type(self) else NotImplemented)

    def __hash__(self) -> int:
        return hash(key_of(self))


def held(value: Any) -> Any:
    """A mapping or list, and what it holds, so that nobody can write to it; an array is marked so."""
    if isinstance(value, np.ndarray):
        value.setflags(write=False)
        return value
    if isinstance(value, Mapping) and not isinstance(value, ReadOnly):
        return MappingProxyType({n: held(v) for n, v in value.items()})
    return tuple(map(held, value)) if type(value) in (list, tuple) else value


def as_dicts(value: Any) -> Any:
    """A value with dictionaries for its mappings, all the way down: as pickle and JSON need it."""
    if isinstance(value, Mapping) and not isinstance(value, ReadOnly):
        return {n: as_dicts(v) for n, v in value.items()}
    return tuple(map(as_dicts, value)) if type(value) is tuple else value


def key_of(value: Any) -> Any:
    """What an object is compared and hashed by: of 0.0 and -0.0 one, of numbers that are none one."""
    if isinstance(value, ReadOnly) and type(value).__eq__ is ReadOnly.__eq__:
        return (type(value), *(key_of(getattr(value, f.name)) for f in fields(value) if f.compare))
    if isinstance(value, np.ndarray):
        plain = np.asarray(value) + 0.0 if value.dtype.kind == "f" else np.asarray(value)
        return (value.shape, value.dtype.str, getattr(value, "names", None), plain.tobytes())
    if isinstance(value, Mapping):
        return tuple((key, key_of(value[key])) for key in sorted(value, key=str))
    if isinstance(value, list | tuple):
        return tuple(map(key_of, value))
    if isinstance(value, Set):
        return frozenset(value)
    return "nan" if isinstance(value, float) and math.isnan(value) else value
