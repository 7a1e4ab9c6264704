"""A segment's centre of mass lies elsewhere."""

from collections.abc import Iterator
from functools import partial

import numpy as np
import pinocchio as pin

from fes_pin.walk.effect import AXES, SITES, Form, WalkEffect, segment_form

_PLAUSIBLE = {"trunk": 0.03, "pelvis": 0.02}
"""m; limbs 0.015: a shank is some 0.05 m thick about its centre."""


class SegmentCom(WalkEffect):
    """A segment's centre of mass lies elsewhere in it than the anthropometric table says.

        c -> c + d, mass and central inertia as believed; d forward, to the left (both legs: outwards), up at neutral

    Tell-tale: a moment that turns with the segment, m g d level, m a d with its acceleration; for the trunk it is the
    classic finding of residual reduction.
    Source: S. L. Delp et al., OpenSim, IEEE Trans. Biomed. Eng. 54:1940, 2007 (RRA moves the torso's centre of mass).
    """

    name = "segment_com"
    vector = "d"

    @classmethod
    def forms(cls) -> Iterator[Form]:
        for site, segments in SITES.items():
            for axes in ((0,), (1,), (2,), *(((0, 1), (0, 2)) if len(segments) == 1 else ())):
                names = tuple(f"{AXES[a]}_m" if len(segments) == 1 or a != 1 else "outwards_m" for a in axes)
                words = " and ".join(n.removesuffix("_m") for n in names)
                change = partial(_shifted, segments=segments, axes=axes)
                yield segment_form(cls.name, f"{site}, {words}", names, _PLAUSIBLE.get(site, 0.015), change)


def _shifted(
    believed: dict[str, np.ndarray], segments: tuple[str, ...], axes: tuple[int, ...]
) -> dict[str, np.ndarray]:
    out = {}
    for s in segments:
        outwards = -1.0 if len(segments) > 1 and s.startswith("right") else 1.0
        columns = [(outwards if a == 1 else 1.0) * _along(believed[s], a) for a in axes]
        out[s] = np.stack(columns, axis=1)
    return out


def _along(believed: np.ndarray, axis: int) -> np.ndarray:
    """Derivative of the ten parameters by the centre's place along an axis, to which they are quadratic: half of what
    1 m ahead and 1 m behind differ by.
    """
    one = pin.Inertia.FromDynamicParameters(believed)
    ahead, behind = (pin.Inertia(one.mass, one.lever + way * np.eye(3)[axis], one.inertia) for way in (1.0, -1.0))
    return 0.5 * (ahead.toDynamicParameters() - behind.toDynamicParameters())
