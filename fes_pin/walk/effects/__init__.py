"""The catalogue of what a walking model may get wrong: one file for each cause."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pkgutil import iter_modules

from fes_pin.walk.effect import Form, WalkEffect


def _written_here() -> Iterator[type[WalkEffect]]:
    for file in iter_modules(__path__, f"{__name__}."):
        for one in vars(import_module(file.name)).values():
            if isinstance(one, type) and issubclass(one, WalkEffect) and one.__module__ == file.name:
                yield one


EFFECTS = tuple(sorted(_written_here(), key=lambda e: e.name))
"""Every cause, by name."""


def walk_library() -> tuple[Form, ...]:
    """Every form of every cause."""
    return tuple(form for effect in EFFECTS for form in effect.forms())
