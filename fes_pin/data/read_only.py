"""Frozen dataclasses whose mappings and arrays cannot be changed either."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np


class ReadOnly:
    """Base of a frozen dataclass: its mappings and arrays are read-only, also in copies and after pickling."""

    def _freeze(self) -> None:
        """Make what is held read-only; called when the object is built and when a copy of it is."""
        for name, value in list(vars(self).items()):
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
            elif isinstance(value, Mapping):
                vars(self)[name] = MappingProxyType(dict(value))

    def __getstate__(self) -> dict[str, Any]:
        return {n: dict(v) if isinstance(v, Mapping) else v for n, v in vars(self).items()}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        vars(self).update(state)
        self._freeze()
