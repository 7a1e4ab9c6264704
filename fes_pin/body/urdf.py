"""The URDF of a body that stands on one forefoot, written from its skeleton."""

from collections.abc import Iterator
from xml.sax.saxutils import quoteattr

import numpy as np

from fes_pin.body.joints import JOINTS, SIDES, BodyJoint, axis_of, joint_limits
from fes_pin.body.skeleton import Skeleton
from fes_pin.data.numbers import in_full, known_word
from fes_pin.data.urdf import MOMENTS

EFFORT_NM, VELOCITY_RADPS = 500.0, 30.0
"""URDF asks for them; above what walking needs, and never used here."""
_SKIN, _TROUSERS, _SHIRT, _SHOE = "0.87 0.72 0.60 1", "0.25 0.33 0.45 1", "0.72 0.42 0.32 1", "0.20 0.20 0.22 1"


def write_urdf(skeleton: Skeleton, stance: str, title: str, provenance: str) -> str:
    """URDF text: a tree of ten segments and 19 revolutes rooted at the stance forefoot, which is fixed to the ground.

    Parameters
    ----------
    skeleton
        The neutral posture.
    stance
        `left` or `right`: the foot on the ground. The world's origin lies on the ground under its MTP joint.
    title
        The robot's name.
    provenance
        Where the figures come from; written as a comment.

    Raises
    ------
    InputError
        Another stance.
    """
    known_word(stance, SIDES, "stance")
    lines = ['<?xml version="1.0"?>', f"<!-- {provenance.replace('--', '-')} -->", f"<robot name={quoteattr(title)}>"]
    root = f"{stance}_forefoot"
    lines += ['  <link name="ground"/>', *_fixed("stance", "ground", root, np.zeros(3))]
    lines += _link(root, skeleton, origin_of(root, skeleton, stance))
    for joint, parent, child in tree(stance):
        here = skeleton.centres[joint.name]
        lines += _joint(joint, parent, child, here - origin_of(parent, skeleton, stance))
        lines += _link(child, skeleton, here)
    if skeleton.height is not None:
        place = skeleton.points["vertex"] - origin_of("trunk", skeleton, stance)
        lines += ['  <link name="vertex"/>', *_fixed("head", "trunk", "vertex", place)]
    return "\n".join([*lines, "</robot>", ""])


def tree(stance: str) -> Iterator[tuple[BodyJoint, str, str]]:
    """Joint, parent segment and child segment, from the stance forefoot outwards."""
    reached, todo = {f"{stance}_forefoot"}, list(JOINTS)
    while todo:
        joint = next(j for j in todo if (j.inner in reached) != (j.outer in reached))
        todo.remove(joint)
        parent, child = (joint.inner, joint.outer) if joint.inner in reached else (joint.outer, joint.inner)
        reached.add(child)
        yield joint, parent, child


def origin_of(segment: str, skeleton: Skeleton, stance: str) -> np.ndarray:
    """Return the origin of a segment's link frame in the neutral posture: at the joint towards the ground, (3,) m."""
    if segment == f"{stance}_forefoot":
        return skeleton.centres[f"{stance}_mtp"] * [1.0, 1.0, 0.0]
    return next(skeleton.centres[joint.name] for joint, _, child in tree(stance) if child == segment)


def _fixed(name: str, parent: str, child: str, xyz: np.ndarray) -> list[str]:
    return [
        f'  <joint name="{name}" type="fixed">',
        f'    <parent link="{parent}"/><child link="{child}"/><origin xyz="{in_full(*xyz)}"/>',
        "  </joint>",
    ]


def _joint(joint: BodyJoint, parent: str, child: str, xyz: np.ndarray) -> list[str]:
    """One revolute, or three with massless links between; walked backwards, order and axes turn round."""
    outwards = parent == joint.inner
    names = joint.revolutes if outwards else joint.revolutes[::-1]
    links = [parent, *(f"{name}_link" for name in names[:-1]), child]
    lines = []
    for k, name in enumerate(names):
        low, high = joint_limits(name)
        axis = axis_of(name) if outwards else -axis_of(name)
        lines += [
            f'  <joint name="{name}" type="revolute">',
            f'    <parent link="{links[k]}"/><child link="{links[k + 1]}"/>',
            f'    <origin xyz="{in_full(*(xyz if k == 0 else np.zeros(3)))}"/><axis xyz="{in_full(*axis + 0.0)}"/>',
            f'    <limit lower="{in_full(low)}" upper="{in_full(high)}" effort="{EFFORT_NM}" '
            f'velocity="{VELOCITY_RADPS}"/>',
            "  </joint>",
        ]
        if k < len(names) - 1:
            lines.append(f'  <link name="{links[k + 1]}"/>')
    return lines


def _link(name: str, skeleton: Skeleton, origin: np.ndarray) -> list[str]:
    segment = skeleton.segments[name]
    values = zip(MOMENTS, segment.inertia[np.triu_indices(3)], strict=True)
    moments = " ".join(f'{key}="{in_full(value)}"' for key, value in values)
    return [
        f'  <link name="{name}">',
        f'    <inertial><origin xyz="{in_full(*segment.com - origin)}"/><mass value="{in_full(segment.mass)}"/>',
        f"      <inertia {moments}/></inertial>",
        *(_visual(shape, origin) for shape in shapes_of(name, skeleton)),
        "  </link>",
    ]


def _visual(shape: tuple, origin: np.ndarray) -> str:
    kind, size, centre, rpy, colour = shape
    text = {
        "sphere": lambda: f'<sphere radius="{size[0]:.5f}"/>',
        "cylinder": lambda: f'<cylinder radius="{size[0]:.5f}" length="{size[1]:.5f}"/>',
        "box": lambda: f'<box size="{size[0]:.5f} {size[1]:.5f} {size[2]:.5f}"/>',
    }[kind]()
    place = " ".join(f"{v:.5f}" for v in centre - origin)
    turn = " ".join(f"{v:.5f}" for v in rpy)
    material = f'<material name="c{colour.replace(" ", "_")}"><color rgba="{colour}"/></material>'
    return f'    <visual><origin xyz="{place}" rpy="{turn}"/><geometry>{text}</geometry>{material}</visual>'


def _bone(a: np.ndarray, b: np.ndarray, radius: float, colour: str) -> list[tuple]:
    """A limb as a cylinder with round ends."""
    d = b - a
    length = float(np.linalg.norm(d))
    rpy = (0.0, float(np.arctan2(np.hypot(d[0], d[1]), d[2])), float(np.arctan2(d[1], d[0])))
    ends: list[tuple] = [("sphere", (radius,), end, (0.0, 0.0, 0.0), colour) for end in (a, b)]
    return [("cylinder", (radius, length), 0.5 * (a + b), rpy, colour), *ends]


def shapes_of(name: str, skeleton: Skeleton) -> list[tuple]:
    """Return the shape of a segment: (kind, size m, centre m, roll-pitch-yaw rad, colour) in neutral world axes."""
    c, p = skeleton.centres, skeleton.points
    side, _, part = name.partition("_")
    leg = float(np.linalg.norm(c["left_hip"] - c["left_knee"]))
    if name == "trunk":
        return _trunk_shapes(skeleton, leg)
    if name == "pelvis":
        left, right = c["left_hip"], c["right_hip"]
        mid = 0.5 * (left + right)
        return [
            *_bone(left, right, 0.20 * leg, _TROUSERS),
            *_bone(mid, mid + 0.8 * (c["lumbar"] - mid), 0.25 * leg, _TROUSERS),
        ]
    if part == "thigh":
        return _bone(c[f"{side}_hip"], c[f"{side}_knee"], 0.155 * leg, _TROUSERS)
    if part == "shank":
        return _bone(c[f"{side}_knee"], c[f"{side}_ankle"], 0.11 * leg, _SKIN)
    ankle, mtp, heel, toe = c[f"{side}_ankle"], c[f"{side}_mtp"], p[f"{side}_heel"], p[f"{side}_toe"]
    width = 0.22 * leg
    if part == "hindfoot":
        thick = 0.55 * (ankle[2] - heel[2])
        centre = np.array([0.5 * (heel[0] + mtp[0]), ankle[1], heel[2] + 0.5 * thick])
        sole = ("box", (mtp[0] - heel[0], width, thick), centre, (0.0, 0.0, 0.0), _SHOE)
        return [sole, *_bone(ankle, np.array([mtp[0], ankle[1], mtp[2] + 0.3 * thick]), 0.09 * leg, _SHOE)]
    thick = 2.0 * (mtp[2] - toe[2])
    centre = np.array([0.5 * (mtp[0] + toe[0]), mtp[1], toe[2] + 0.5 * thick])
    return [("box", (toe[0] - mtp[0], width, thick), centre, (0.0, 0.0, 0.0), _SHOE)]


def _trunk_shapes(skeleton: Skeleton, leg: float) -> list[tuple]:
    c, p = skeleton.centres, skeleton.points
    lumbar, vertex = c["lumbar"], p["vertex"]
    neck = p.get("neck", lumbar + 0.72 * (vertex - lumbar))
    chest = lumbar + 0.62 * (neck - lumbar)
    across = np.array([0.0, 0.17 * leg, 0.0])
    radius = max(0.42 * float(np.linalg.norm(vertex - neck)), 0.2 * leg)
    head = vertex - np.array([0.0, 0.0, radius])
    shapes = [
        *_bone(lumbar, chest, 0.25 * leg, _SHIRT),
        *_bone(chest - across, chest + across, 0.24 * leg, _SHIRT),
        *_bone(chest, head, 0.11 * leg, _SKIN),
        ("sphere", (radius,), head, (0.0, 0.0, 0.0), _SKIN),
    ]
    for side in SIDES:
        if f"{side}_shoulder" in p:
            shapes += _bone(p[f"{side}_shoulder"], p[f"{side}_elbow"], 0.095 * leg, _SHIRT)
            shapes += _bone(p[f"{side}_elbow"], p[f"{side}_fingers"], 0.075 * leg, _SKIN)
    return shapes
