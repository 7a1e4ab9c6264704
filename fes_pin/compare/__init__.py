"""Models of the literature on a study's trials, ranked; the chapter is callable: `fes_pin.compare(study)`."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any


class _Chapter(ModuleType):
    """The chapter and its verb share a name, so the chapter answers a call."""

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """See `fes_pin.compare.compare.compare`."""
        from fes_pin.compare.compare import compare  # noqa: PLC0415

        return compare(*args, **kwargs)


sys.modules[__name__].__class__ = _Chapter
