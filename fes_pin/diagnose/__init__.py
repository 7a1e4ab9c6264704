"""What a simulation gets wrong, and its cause by name; the chapter is callable: `fes_pin.diagnose(study)`."""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import Any


class _Chapter(ModuleType):
    """The chapter and its verb share a name, so the chapter answers a call."""

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """See `fes_pin.verdict.ask.diagnose`, which the package gives by the same name."""
        return import_module("fes_pin").__getattr__("diagnose")(*args, **kwargs)


sys.modules[__name__].__class__ = _Chapter
