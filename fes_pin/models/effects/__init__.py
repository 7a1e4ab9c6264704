"""The catalogue: one file for each physical thing that a nominal model may leave out.

An effect is in the tests, the report, the documentation and the diagnosis by its file in this folder.
"""

from fes_pin.models.stage import Effect, by_name, classes_in, in_order

EFFECTS = in_order(classes_in(__path__, __name__, Effect))
"""The effects of this folder's files, in the order of the signal path, by name at each stage."""
globals().update({one.__name__: one for one in EFFECTS})  # `effects.CoulombFriction`; their types: `__init__.pyi`


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
