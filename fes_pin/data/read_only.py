"""Frozen dataclasses whose mappings and arrays cannot be changed either."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np


class ReadOnly:
    """Base of a frozen dataclass: its mappings, lists and arrays are read-only, also in copies and after pickling."""

    def __post_init__(self) -> None:
        self._freeze()

    def _freeze(self) -> None:
        """Make what is held read-only; called when the object is built and when a copy of it is."""
        for name, value in list(vars(self).items()):
            vars(self)[name] = _held(value)

    def __getstate__(self) -> dict[str, Any]:
        return {n: as_dicts(v) for n, v in vars(self).items()}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        vars(self).update(state)
        self._freeze()


def _held(value: Any) -> Any:
    """A mapping or list, and what it holds, so that nobody can write to it; an array is marked so."""
    if isinstance(value, Mapping):
        return MappingProxyType({n: _held(v) for n, v in value.items()})
    if type(value) in (list, tuple):
        return tuple(map(_held, value))
    if isinstance(value, np.ndarray):
        value.setflags(write=False)
    return value


def as_dicts(value: Any) -> Any:
    """A value with dictionaries for its mappings, all the way down: as pickle and JSON need it."""
    if isinstance(value, Mapping):
        return {n: as_dicts(v) for n, v in value.items()}
    return tuple(map(as_dicts, value)) if type(value) is tuple else value
