"""Results that cannot be changed, are equal by value, and stay so in copies and pickles."""

from __future__ import annotations

from typing import Any

import numpy as np


class Fixed:
    """Base of frozen dataclasses with slots: their arrays are read-only, and two are equal if all that they hold is."""

    __slots__ = ()

    def __post_init__(self) -> None:
        for value in self._values():
            if type(value) is np.ndarray:
                value.setflags(write=False)

    def _values(self) -> tuple[Any, ...]:
        return tuple([getattr(self, item) for item in self.__dataclass_fields__])  # type: ignore[attr-defined]

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._values()

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        pairs = zip(self._values(), other._values(), strict=True)
        return all(np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b for a, b in pairs)

    def __hash__(self) -> int:
        return hash((type(self), *(v.tobytes() for v in self._values() if isinstance(v, np.ndarray))))
