"""A segment is heavier or lighter than believed."""

from collections.abc import Callable, Iterator

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
        for site, segments in SITES.items():
            yield segment_form(cls.name, site, ("share",), ("",), (0.2,), _added(segments))
        for site, segments in SITES.items():
            moved = f"{site}, taken from the others"
            yield segment_form(cls.name, moved, ("share",), ("",), (0.2,), _moved(segments))


def _added(segments: tuple[str, ...]) -> Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]]:
    def change(believed: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        return {s: believed[s][:, None] for s in segments}

    return change


def _moved(segments: tuple[str, ...]) -> Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]]:
    def change(believed: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        others = [s for s in believed if s not in segments]
        ratio = sum(believed[s][0] for s in segments) / sum(believed[s][0] for s in others)
        return {**_added(segments)(believed), **{s: -ratio * believed[s][:, None] for s in others}}

    return change
