"""The catalogue of what a walking model may get wrong: one file for each cause."""

from fes_pin.models.stage import classes_in
from fes_pin.walk.effect import Form, WalkEffect

EFFECTS = tuple(sorted(classes_in(__path__, __name__, WalkEffect), key=lambda e: e.name))
"""Every cause, by name."""


def walk_library() -> tuple[Form, ...]:
    """Every form of every cause."""
    return tuple(form for effect in EFFECTS for form in effect.forms())
