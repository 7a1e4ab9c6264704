"""The mass that is stated of the body is not what it was."""

from collections.abc import Iterator

import numpy as np

from fes_pin.walk.effect import Form, WalkEffect, segment_form


class StatedMass(WalkEffect):
    """The body weighs more or less than is stated of it.

        mass_kg of the body = value; every segment heavier by the same share

    Tell-tale: the residual is a share of the whole required reaction; the mean vertical force over whole strides is
    another weight.
    Source: weight = mean vertical force, as momentum returns to its initial value.
    """

    name = "condition_misread"

    @classmethod
    def forms(cls) -> Iterator[Form]:
        yield segment_form(cls.name, "mass_kg", ("share",), 0.2, _scaled)


def _scaled(believed: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {s: own[:, None] for s, own in believed.items()}
