"""Paths of the leg's muscles: points on bones, from which lengths and moment arms follow at any posture.

A muscle runs straight from point to point. The kneecap's end of the quadriceps moves with the knee, which also slides.
Some points are edges of bone that a muscle touches in part of a joint's range only (`Edge`). The bones turn about the
joints of the body (`fes_pin.body.joints`), each about its own axis, so that a moment arm, minus the derivative of the
length along a joint's angle, is the torque about that joint per unit of force.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from fes_pin.body.joints import axis_of
from fes_pin.data.legs import turn
from fes_pin.data.read_only import ReadOnly
from fes_pin.data.table import own_table

BODIES = ("pelvis", "femur", "tibia", "calcaneus", "toes")

# Right leg of the source model (tables/SOURCE.md): x forward, y up, z right; m.
HIP = (-0.07244, -0.06772, 0.08555)
ANKLE = (0.0, -0.425065, 0.0)
HEEL_BONE = (-0.0543287, -0.0467314, 0.00882271)
"""Origin of the calcaneus's frame, from the ankle."""
MTP = (0.183643, -0.00205417, 0.00110925)


@dataclass(frozen=True)
class Hinge:
    """A step of the chain from the pelvis to the toes: a shift, then a turn.

    Parameters
    ----------
    coordinate
        The angle that turns it; "" for a shift alone.
    axis
        About which, in the frame so far, right leg.
    of, offset
        The body whose size scales the shift, and the shift, m; without, at the knee, the tibia's slide.
    reaches
        Whether the next of `BODIES` begins here.
    """

    coordinate: str
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    of: str = "femur"
    offset: tuple[float, float, float] | None = (0.0, 0.0, 0.0)
    reaches: bool = False


def _own(coordinate: str, **options: Any) -> Hinge:
    """A hinge about the body's axis (x forward, y left, z up)."""
    forward, left, up = (float(x) for x in axis_of(f"right_{coordinate}"))
    return Hinge(coordinate, (forward, up, -left), **options)


HINGES = (
    _own("hip_flexion", of="pelvis", offset=HIP),
    _own("hip_adduction"),
    _own("hip_rotation", reaches=True),
    _own("knee_flexion", offset=None, reaches=True),
    _own("ankle_dorsiflexion", of="tibia", offset=ANKLE),
    _own("ankle_inversion"),
    _own("ankle_rotation"),
    Hinge("", of="talus", offset=HEEL_BONE, reaches=True),
    _own("mtp_extension", of="calcaneus", offset=MTP, reaches=True),
)
COORDINATES = tuple(hinge.coordinate for hinge in HINGES if hinge.coordinate)
"""The angles of a leg, in the order of its arrays: those of the body."""
MOVED_FROM = np.array([1, 1, 1, 2, 3, 3, 3, 4])
"""The first of `BODIES` that each of `COORDINATES` moves."""

DEEP_M, GROOVE_M = 0.0045, 0.0045
"""Pressed this deep against an edge, a muscle stays at its point; and pulled no further sideways than this along it
(ours: the least with which all muscles keep the source's paths at the four postures of tables/SOURCE.md)."""
TURN_ON, LEAVE = np.radians((-7.0, 13.0)), np.radians(25.0)
"""Where the source's path begins to pass an edge at an angle, ours comes upon it from the first to the second of these
beyond it, rad; where the source's ends, ours does so this far beyond at the latest (ours, as above)."""
_STEP = 1e-20
"""Imaginary step of derivatives: lengths are analytic, so that no digit is lost."""


def read_table(name: str) -> list[dict[str, str]]:
    """Rows of one of the tables that ship with the package."""
    return own_table(Path(__file__).parent / "tables" / name)


def _spline(curve: Any, x: np.ndarray) -> np.ndarray:
    """A spline, also of angles with an imaginary step."""
    if not np.iscomplexobj(x):
        return curve(x)
    slope = curve(x.real, 1)
    return curve(x.real) + 1j * x.imag.reshape(-1, *[1] * (slope.ndim - 1)) * slope


def _norm(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt((vectors * vectors).sum(axis=-1))


def _smooth(x: np.ndarray) -> np.ndarray:
    """0 up to 0, 1 from 1 on, with a continuous slope."""
    x = np.where(x.real <= 0.0, 0.0, np.where(x.real >= 1.0, 1.0, x))
    return x * x * (3.0 - 2.0 * x)


@dataclass(frozen=True)
class Edge:
    """A point of a path that is passed in part of a joint's range: an edge of bone across the leg.

    A muscle touches it where, seen from the side, the straight line from the point before to the point after would run
    through the bone, whatever the other joints do. It then runs over the edge: through the point of the source, if it
    is pressed `DEEP_M` deep; as it comes off, it slides along the edge to where the straight line leaves it. Lengths
    and moment arms are continuous.

    Parameters
    ----------
    point, after
        Its index, and that of the next point that is always passed.
    coordinate
        Index of the angle that brings it on.
    low, high
        Angles between which the source's path passes it, rad.
    side
        1 where the muscle runs on the front of the bone, -1 on the back.
    """

    point: int
    after: int
    coordinate: int
    low: float
    high: float
    side: float

    def passed(self, angle: np.ndarray, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Whether the muscle touches it, (n,) bool, and where the muscle then passes, in the bone's frame: (n, 3) m.

        Parameters
        ----------
        angle
            Of its coordinate, (n,) rad.
        a, b
            The points before and after in the bone's frame, from this one: (n, 3) m.
        """
        depth = self.side * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / _norm(a[:, :2] - b[:, :2])
        share = (_norm(a[:, :2]) / (_norm(a[:, :2]) + _norm(b[:, :2])))[:, None]
        straight = a + (b - a) * share
        along = straight[:, 2]
        size = np.where(along.real < 0.0, -along, along)
        held = _smooth(depth / DEEP_M) * _smooth(2.0 - size / GROOVE_M)
        on = 1.0 - _smooth((angle - self.high) / LEAVE) if np.isfinite(self.high) else np.ones_like(angle)
        if np.isfinite(self.low):
            on = on * _smooth((angle - self.low - TURN_ON[0]) / np.ptp(TURN_ON))
        over = np.stack([0.0 * along, 0.0 * along, along * (1.0 - held)], axis=-1)
        return (depth.real > 0.0) & (on.real > 0.0), straight + on[:, None] * (over - straight)


@dataclass(frozen=True, eq=False)
class LegPaths(ReadOnly):
    """Points of the muscles of a right leg.

    Attributes
    ----------
    names
        Muscles, in the order of their points.
    first
        (muscles,) index of each muscle's first point.
    body, place
        (points,) index into `BODIES`, and (points, 3) in that body, m.
    edges
        Points that are passed in part of a joint's range.
    kneecap
        Index of the moving points and a spline of their x, y over the knee's flexion, m.
    slide
        Spline of the tibia's origin in the femur, x and y, over the knee's flexion, m.
    size
        Factor on each body of `BODIES`, and on the talus: 1 is the subject of the tables.
    hinges
        How the bones turn.
    """

    names: tuple[str, ...]
    first: np.ndarray
    body: np.ndarray
    place: np.ndarray
    edges: tuple[Edge, ...]
    kneecap: tuple[tuple[int, Any], ...]
    slide: tuple[Any, Any]
    size: Mapping[str, float]
    hinges: tuple[Hinge, ...] = HINGES

    def lengths(self, angles: np.ndarray) -> np.ndarray:
        """Lengths of muscle and tendon, m: (n, muscles) for angles (n, 8) in the order of `COORDINATES`, rad."""
        ahead = np.diff(self._points(angles), axis=1, append=0.0)
        ahead[:, np.append(self.first[1:] - 1, -1)] = 0.0
        return np.add.reduceat(_norm(ahead), self.first, axis=1)

    def moment_arms(self, angles: np.ndarray) -> np.ndarray:
        """Minus the derivatives of the lengths over the angles: (n, 8, muscles), m."""
        steps = angles[:, None] + 1j * _STEP * np.eye(len(COORDINATES))
        lengths = self.lengths(steps.reshape(-1, len(COORDINATES)))
        slopes = lengths.imag.reshape(len(angles), len(COORDINATES), len(self.names)) / _STEP
        return np.where(self.crossed, -slopes, 0.0)

    @property
    def crossed(self) -> np.ndarray:
        """Which of the coordinates each muscle crosses, (8, muscles): about the others it has no arm."""
        inner, outer = (f.reduceat(self.body, self.first) for f in (np.minimum, np.maximum))
        return (inner < MOVED_FROM[:, None]) & (outer >= MOVED_FROM[:, None])

    def _frames(self, angles: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Turn (n, 3, 3) and origin (n, 3) of every body, in the pelvis."""
        rotation, origin = np.broadcast_to(np.eye(3), (len(angles), 3, 3)), np.zeros((len(angles), 3))
        turns, origins = [rotation], [origin]
        for hinge in self.hinges:
            angle = angles[:, COORDINATES.index(hinge.coordinate)] if hinge.coordinate else np.zeros(len(angles))
            offset = hinge.offset or np.stack([*(_spline(s, angle) for s in self.slide), 0.0 * angle], axis=-1)
            origin = origin + (rotation @ (self.size[hinge.of] * np.asarray(offset))[..., None])[..., 0]
            rotation = rotation @ turn(hinge.axis, angle)
            if hinge.reaches:
                turns.append(rotation)
                origins.append(origin)
        return turns, origins

    def _points(self, angles: np.ndarray) -> np.ndarray:
        """Points in the pelvis: (n, points, 3). A point that is not passed lies on the one before it."""
        turns, origins = self._frames(angles)
        points = np.empty((len(angles), len(self.body), 3), dtype=angles.dtype)
        for k, name in enumerate(BODIES):
            mine = self.body == k
            points[:, mine] = self.size[name] * self.place[mine] @ np.swapaxes(turns[k], 1, 2) + origins[k][:, None]
        tibia = BODIES.index("tibia")
        for i, spline in self.kneecap:
            track = self.size["tibia"] * _spline(spline, angles[:, COORDINATES.index("knee_flexion")])
            points[:, i] += np.einsum("nkl,nl->nk", turns[tibia][:, :, :2], track)
        for edge in self.edges:
            i, angle = edge.point, angles[:, edge.coordinate]
            apart = (points[:, j] - points[:, i] for j in (i - 1, edge.after))
            a, b = (np.einsum("nlk,nl->nk", turns[self.body[i]], one) for one in apart)
            touched, place = edge.passed(angle, a, b)
            over = points[:, i] + np.einsum("nkl,nl->nk", turns[self.body[i]], place)
            points[:, i] = np.where(touched[:, None], over, points[:, i - 1])
        return points


@lru_cache(maxsize=1)
def leg_paths() -> LegPaths:
    """The paths that ship with the package (tables/SOURCE.md)."""
    rows = read_table("paths.csv")
    names = tuple(dict.fromkeys(row["muscle"] for row in rows))
    owner = [row["muscle"] for row in rows]
    carrying = {**{b: k for k, b in enumerate(BODIES)}, "patella": BODIES.index("tibia")}
    return LegPaths(
        names=names,
        first=np.array([owner.index(name) for name in names]),
        body=np.array([carrying[row["body"]] for row in rows]),
        place=np.array([[float(row[f"{axis}_mm"] or 0.0) / 1e3 for axis in "xyz"] for row in rows]),
        edges=tuple(_edges(rows)),
        kneecap=tuple(_kneecap(rows)),
        slide=(_slide("forward"), _slide("up")),
        size=dict.fromkeys((*BODIES, "talus"), 1.0),
    )


def _edges(rows: list[dict[str, str]]) -> Iterator[Edge]:
    for i, row in enumerate(rows):
        if row["joint"]:
            front = row["joint"] == "hip_flexion" or bool(row["from_deg"])
            low, high = (np.radians(float(row[key] or end)) for key, end in (("from_deg", -np.inf), ("to_deg", np.inf)))
            after = next(k for k in range(i + 1, len(rows)) if not rows[k]["joint"])
            yield Edge(i, after, COORDINATES.index(row["joint"]), low, high, 1.0 if front else -1.0)


def _kneecap(rows: list[dict[str, str]]) -> Iterator[tuple[int, Any]]:
    """Points that move with the kneecap, and splines of their x, y over the knee's flexion, m."""
    patella = read_table("patella.csv")
    flexion = np.radians([float(row["knee_flexion_deg"]) for row in patella])
    for i, row in enumerate(rows):
        if row["body"] == "patella":
            track = [[float(p[f"{row['muscle']}_{axis}_mm"]) / 1e3 for axis in "xy"] for p in patella]
            yield i, CubicSpline(flexion, np.array(track))


def _slide(direction: str) -> Any:
    """Spline of the tibia's origin in the femur over the knee's flexion, m."""
    rows = [row for row in read_table("knee.csv") if row["direction"] == direction]
    flexion = np.radians([float(row["knee_flexion_deg"]) for row in rows])
    return CubicSpline(flexion, np.array([float(row["shift_mm"]) / 1e3 for row in rows]))
