"""What differs between groups of trials of one rig; the chapter is callable: `fes_pin.contrast(study)`."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any


class _Chapter(ModuleType):
    """The chapter and its verb share a name, so the chapter answers a call."""

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """See `fes_pin.contrast.contrast.contrast`."""
        from fes_pin.contrast.contrast import contrast  # noqa: PLC0415

        return contrast(*args, **kwargs)


sys.modules[__name__].__class__ = _Chapter
