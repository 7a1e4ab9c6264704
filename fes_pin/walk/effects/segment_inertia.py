"""A segment's inertia tensor is off."""

from collections.abc import Iterator
from functools import partial

import numpy as np
import pinocchio as pin

from fes_pin.walk.effect import SITES, Form, WalkEffect, segment_form


class SegmentInertia(WalkEffect):
    """A segment's inertia about its centre of mass is off by a factor.

        I -> (1 + share) I, mass and centre as believed

    Tell-tale: a moment as the segment's angular acceleration, and no force.
    Source: radii of gyration of different tables differ by some 10 %: de Leva, J. Biomech. 29, 1996.
    """

    name = "segment_inertia"

    @classmethod
    def forms(cls) -> Iterator[Form]:
        for site, segments in SITES.items():
            yield segment_form(cls.name, site, ("share",), 0.3, partial(_scaled, segments=segments))


def _scaled(believed: dict[str, np.ndarray], segments: tuple[str, ...]) -> dict[str, np.ndarray]:
    inertias = {s: pin.Inertia.FromDynamicParameters(believed[s]).inertia for s in segments}
    return {s: pin.Inertia(0.0, np.zeros(3), i).toDynamicParameters()[:, None] for s, i in inertias.items()}
