"""The catalogue: one file for each physical thing that a nominal model may leave out.

An effect is in the tests, the report, the documentation and the diagnosis by its file in this folder.
"""

from typing import Any

from fes_pin.models.stage import Effect, by_name, classes_in, in_order

EFFECTS = in_order(classes_in(__path__, __name__, Effect))
"""The effects of this folder's files, in the order of the signal path, by name at each stage."""


def __getattr__(name: str) -> Any:  # each has parameters of its own, which no type of all effects names
    """An effect by the name of its class: `effects.CoulombFriction`."""
    for one in EFFECTS:
        if one.__name__ == name:
            return one
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """Return the public names of this module and the classes of the effects."""
    return sorted((*globals(), *(one.__name__ for one in EFFECTS)))


def effect_named(name: str) -> type[Effect]:
    """The effect of that name.

    Raises
    ------
    InputError
        If the catalogue has none.
    """
    return by_name(EFFECTS, name)


def effects_for(rig: str) -> tuple[type[Effect], ...]:
    """The effects that a rig can have."""
    return tuple(e for e in EFFECTS if rig in e.rigs)
