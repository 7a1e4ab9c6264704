"""Sets of causes, by the names of the causes in alphabetical order."""

from fes_pin.identify.fit import Fit
from fes_pin.infer.search import Names


def names_of(fitted: Fit) -> Names:
    """Return the names of the causes in a fit, in alphabetical order."""
    return tuple(sorted(e.name for e in fitted.model.effects))
