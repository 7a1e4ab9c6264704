"""The generators of studies by name."""

from importlib import import_module
from pathlib import Path

from harness.generator import Generator
from harness.practice import Practice

GENERATORS = {
    "free": ("free", "Free"),
    "driven": ("driven", "Driven", "plain"),
    "recorded": ("driven", "Driven", "recorded"),
    "low-passed": ("driven", "Driven", "low-passed"),
    "every-fifth": ("driven", "Driven", "every-fifth"),
    "play": ("driven", "Driven", "play"),
    "laboratory": ("driven", "Driven", "laboratory"),
    "swing-up": ("driven", "Driven", "swing-up"),
    "arm": ("driven", "Driven", "arm"),
    "stimulated": ("driven", "Driven", "stimulated"),
    "no-form": ("driven", "Driven", "no-form"),
    "imposed": ("imposed", "Imposed"),
    "contrast": ("contrast", "Pairs"),
    "halved": ("contrast", "Halved"),
    "misread": ("misread", "Misread"),
    "voluntary": ("voluntary", "Voluntary"),
    "large": ("large", "Large"),
    "by-trial": ("by_trial", "ByTrial"),
    "walking": ("walking", "Walks"),
}
"""By name: module of this package, class, and what it is made with."""


def generator_of(name: str) -> Generator:
    """The generator of a name, or of a folder of studies whose answers lie in its folder `answers`.

    Raises
    ------
    KeyError
        There is none.
    """
    if Path(name, "answers").is_dir():
        return Practice(Path(name))
    module, kind, *given = GENERATORS[name]
    generator: Generator = getattr(import_module(f"harness.{module}"), kind)(*given)
    return generator
