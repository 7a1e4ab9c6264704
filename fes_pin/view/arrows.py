"""Forces to look at: arrows that move with a body, for pages of `view.viewer`."""

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

SHAFT_M, HEAD_M = 0.012, 0.03
"""Radii of an arrow's shaft and of its head; the head is three radii long."""
HIDDEN_M = 1e-3
"""Arrows shorter than this are not seen."""
_ALONG = np.array([0.0, 1.0, 0.0])
"""meshcat's cylinders lie along y."""


@dataclass(frozen=True)
class Arrow:
    """An arrow that moves.

    Attributes
    ----------
    foot, vector
        (T, 3) m: where it starts, and how far it points.
    colour
        As 0xRRGGBB.
    """

    foot: np.ndarray = field(repr=False)
    vector: np.ndarray = field(repr=False)
    colour: int = 0x17191C


def draw_arrow(arrow: Arrow, place, animation) -> None:
    """Draw an arrow at a place of meshcat's viewer; its motion goes into the animation."""
    from meshcat.geometry import Cylinder, MeshLambertMaterial  # noqa: PLC0415

    parts = {"shaft": Cylinder(1.0, SHAFT_M), "head": Cylinder(3.0 * HEAD_M, radiusTop=0.0, radiusBottom=HEAD_M)}
    for part, shape in parts.items():
        place[part].set_object(shape, MeshLambertMaterial(color=arrow.colour))
        for t, (foot, vector) in enumerate(zip(arrow.foot, arrow.vector, strict=True)):
            turn, middle, scale = _placed(part, foot, vector)
            placed = pin.SE3(turn, middle).homogeneous
            if t == 0:
                place[part].set_transform(placed @ np.diag([*scale, 1.0]))
            frame = animation.at_frame(place[part], t)
            frame.set_transform(placed)
            frame.set_property("scale", "vector3", scale.tolist())


def _placed(part: str, foot: np.ndarray, vector: np.ndarray) -> tuple[pin.Quaternion, np.ndarray, np.ndarray]:
    """Rotation, middle and scale of an arrow's part; an arrow that is too short has no size."""
    length = float(np.linalg.norm(vector))
    if length < HIDDEN_M:
        return pin.Quaternion.Identity(), foot, np.full(3, 1e-6)
    along = vector / length
    turn = pin.Quaternion.FromTwoVectors(_ALONG, along)
    shaft = max(length - 3.0 * HEAD_M, 1e-6)
    if part == "shaft":
        return turn, foot + 0.5 * shaft * along, np.array([1.0, shaft, 1.0])
    return turn, foot + (shaft + 1.5 * HEAD_M) * along, np.ones(3)
