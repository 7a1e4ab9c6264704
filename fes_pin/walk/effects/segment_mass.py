"""A segment is heavier or lighter than believed."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from fes_pin.walk.effect import SITES, Form, WalkEffect, segment_form


class SegmentMass(WalkEffect):
    """A segment is heavier or lighter than the anthropometric table says.

        m -> (1 + share) m, centre and radii of gyration as believed; the body heavier by it, or as heavy as weighed

    Tell-tale: the residual is the segment's own m (a - g), at its place.
    Source: spread of segment masses between methods and people, some 10 % for limbs: de Leva, J. Biomech. 29, 1996.
    """

    name = "segment_mass"

    @classmethod
    def forms(cls) -> Iterator[Form]:
        for change, words in ((_added, ""), (_moved, ", taken from the others")):
            for site, segments in SITES.items():
                yield segment_form(cls.name, f"{site}{words}", ("share",), 0.2, partial(change, segments=segments))


def _added(believed: dict[str, np.ndarray], segments: tuple[str, ...]) -> dict[str, np.ndarray]:
    return {s: believed[s][:, None] for s in segments}


def _moved(believed: dict[str, np.ndarray], segments: tuple[str, ...]) -> dict[str, np.ndarray]:
    others = [s for s in believed if s not in segments]
    ratio = sum(believed[s][0] for s in segments) / sum(believed[s][0] for s in others)
    return {**_added(believed, segments), **{s: -ratio * believed[s][:, None] for s in others}}
