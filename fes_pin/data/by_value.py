"""Frozen dataclasses that hold arrays, compared and hashed by what they hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from fes_pin.data.read_only import ReadOnly


class ByValue(ReadOnly):
    """Base of a frozen dataclass (`eq=False`): equal where all it holds is, arrays and mappings too; read-only."""

    def __eq__(self, other: object) -> bool:
        return key_of(self) == key_of(other) if type(other) is type(self) else NotImplemented

    def __hash__(self) -> int:
        return hash(key_of(self))


def key_of(value: Any) -> Any:
    """What an object is compared and hashed by: of 0.0 and -0.0 one, of numbers that are none one."""
    if isinstance(value, ByValue):
        return (type(value), *(key_of(getattr(value, f.name)) for f in fields(value) if f.compare))  # type: ignore[arg-type]
    if isinstance(value, np.ndarray):
        plain = np.asarray(value) + 0.0 if value.dtype.kind == "f" else np.asarray(value)
        return (value.shape, getattr(value, "names", None), plain.tobytes())
    if isinstance(value, Mapping):
        return tuple(sorted((key_of(k), key_of(v)) for k, v in value.items()))
    return tuple(map(key_of, value)) if isinstance(value, list | tuple) else value
