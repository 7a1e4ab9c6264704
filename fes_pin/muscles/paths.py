"""Paths of the leg's muscles: points on bones, from which lengths and moment arms follow at any posture.

A muscle runs straight from point to point; some points are passed only in part of a joint's range, and the kneecap's
end of the quadriceps moves with the knee, which also slides. A moment arm is minus the derivative of the length.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

COORDINATES = (
    "hip_flexion",
    "hip_adduction",
    "hip_rotation",
    "knee_flexion",
    "ankle_dorsiflexion",
    "ankle_inversion",
    "mtp_extension",
)
"""The angles of a leg, in the order of its arrays."""
BODIES = ("pelvis", "femur", "tibia", "calcaneus", "toes")
MOVED_FROM = np.array([1, 1, 1, 2, 3, 3, 4])
"""The first of `BODIES` that each of `COORDINATES` moves."""

# Right leg of the source model (tables/SOURCE.md): x forward, y up, z right; m.
HIP = np.array([-0.07244, -0.06772, 0.08555])
ANKLE = np.array([0.0, -0.425065, 0.0])
SUBTALAR = np.array([-0.0543287, -0.0467314, 0.00882271])
MTP = np.array([0.183643, -0.00205417, 0.00110925])
ANKLE_AXIS = (-0.10501355, -0.17402245, 0.97912632)
SUBTALAR_AXIS = (0.78717961, 0.60474746, -0.12094949)
MTP_AXIS = (-0.5809544, 0.0, 0.81393611)


def read_table(name: str) -> list[dict[str, str]]:
    """Rows of one of the tables that ship with the package."""
    text = (files("fes_pin.muscles") / "tables" / name).read_text()
    return list(csv.DictReader(text.splitlines()))


def turn(axis, angle: np.ndarray) -> np.ndarray:
    """Rotations about an axis by angles (n,), rad: (n, 3, 3)."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle)[:, None, None] * cross + (1.0 - np.cos(angle))[:, None, None] * (cross @ cross)


@dataclass(frozen=True, eq=False)
class LegPaths:
    """Points of the muscles of a right leg.

    Attributes
    ----------
    names
        Muscles, in the order of their points.
    first
        (muscles,) index of each muscle's first point.
    body, place
        (points,) index into `BODIES`, and (points, 3) in that body, m.
    passed
        Per point that is not always passed: its index, the coordinate, and the angles between which it is, rad.
    kneecap
        Index of the moving points and a spline of their x, y over the knee's flexion, m.
    slide
        Spline of the tibia's origin in the femur, x and y, over the knee's flexion, m.
    size
        Factor on each body of `BODIES`, and on the talus: 1 is the subject of the tables.
    """

    names: tuple[str, ...]
    first: np.ndarray
    body: np.ndarray
    place: np.ndarray
    passed: tuple[tuple[int, int, float, float], ...]
    kneecap: tuple[tuple[int, Any], ...]
    slide: tuple[Any, Any]
    size: Mapping[str, float]

    def lengths(self, angles: np.ndarray) -> np.ndarray:
        """Lengths of muscle and tendon, m: (n, muscles) for angles (n, 7) in the order of `COORDINATES`, rad."""
        points, _ = self._points(angles, *self._frames(angles)[:2])
        return np.add.reduceat(self._segments(points)[1], self.first, axis=1)

    def moment_arms(self, angles: np.ndarray) -> np.ndarray:
        """Minus the derivatives of the lengths over the angles: (n, 7, muscles), m."""
        turns, origins, axes, centres = self._frames(angles)
        points, carrier = self._points(angles, turns, origins)
        ahead, _ = self._segments(points)
        behind = np.concatenate([np.zeros_like(ahead[:, :1]), ahead[:, :-1]], axis=1)
        pull = behind - ahead  # derivative of the length over each point
        arms = np.empty((len(angles), len(COORDINATES), len(self.names)))
        for j, first_moved in enumerate(MOVED_FROM):
            lever = np.cross(points - centres[:, j, None], pull) @ axes[:, j, :, None]
            change = np.where(carrier >= first_moved, lever[..., 0], 0.0)
            if COORDINATES[j] == "knee_flexion":
                change += self._sliding(angles[:, j], turns, carrier, pull)
            arms[:, j] = -np.add.reduceat(change, self.first, axis=1)
        return np.where(self.crossed, arms, 0.0)

    @property
    def crossed(self) -> np.ndarray:
        """Which of the coordinates each muscle crosses, (7, muscles): about the others it has no arm."""
        inner, outer = (f.reduceat(self.body, self.first) for f in (np.minimum, np.maximum))
        return (inner < MOVED_FROM[:, None]) & (outer >= MOVED_FROM[:, None])

    def _sliding(self, flexion, turns, carrier, pull) -> np.ndarray:
        """Change of length at each point because the tibia and the kneecap's points slide as the knee bends."""
        slide = self.size["femur"] * np.stack([s(flexion, 1) for s in self.slide] + [0.0 * flexion], axis=-1)
        along = pull @ (turns[1] @ slide[..., None])
        change = np.where(carrier >= 2, along[..., 0], 0.0)
        for i, spline in self.kneecap:
            rate = self.size["tibia"] * np.concatenate([spline(flexion, 1), 0.0 * flexion[:, None]], axis=-1)
            change[:, i] += np.einsum("nk,nkl,nl->n", pull[:, i], turns[2], rate)
        return change

    def _frames(self, angles: np.ndarray):
        """Turn and origin of every body, and axis and centre of every coordinate, in the pelvis."""
        hip, size = angles.T, self.size
        count = len(angles)
        flexed = turn((0.0, 0.0, 1.0), hip[0])
        adducted = flexed @ turn((1.0, 0.0, 0.0), hip[1])
        femur = adducted @ turn((0.0, 1.0, 0.0), hip[2])
        tibia = femur @ turn((0.0, 0.0, 1.0), -hip[3])
        talus = tibia @ turn(ANKLE_AXIS, hip[4])
        calcaneus = talus @ turn(SUBTALAR_AXIS, hip[5])
        toes = calcaneus @ turn(MTP_AXIS, hip[6])
        slide = size["femur"] * np.stack([s(hip[3]) for s in self.slide] + [0.0 * hip[3]], axis=-1)
        at_hip = np.broadcast_to(size["pelvis"] * HIP, (count, 3))
        at_knee = at_hip + (femur @ slide[..., None])[..., 0]
        at_ankle = at_knee + tibia @ (size["tibia"] * ANKLE)
        at_subtalar = at_ankle + talus @ (size["talus"] * SUBTALAR)
        at_mtp = at_subtalar + calcaneus @ (size["calcaneus"] * MTP)
        still = np.broadcast_to(np.eye(3), (count, 3, 3))

        def axis(frame, direction):
            return frame @ (np.asarray(direction) / np.linalg.norm(direction))

        axes = np.stack(
            [
                np.broadcast_to([0.0, 0.0, 1.0], (count, 3)),
                axis(flexed, (1.0, 0.0, 0.0)),
                axis(adducted, (0.0, 1.0, 0.0)),
                axis(femur, (0.0, 0.0, -1.0)),
                axis(tibia, ANKLE_AXIS),
                axis(talus, SUBTALAR_AXIS),
                axis(calcaneus, MTP_AXIS),
            ],
            axis=1,
        )
        centres = np.stack([at_hip, at_hip, at_hip, at_knee, at_ankle, at_subtalar, at_mtp], axis=1)
        turns = np.stack([still, femur, tibia, calcaneus, toes])
        origins = np.stack([np.zeros((count, 3)), at_hip, at_knee, at_subtalar, at_mtp])
        return turns, origins, axes, centres

    def _points(self, angles, turns, origins) -> tuple[np.ndarray, np.ndarray]:
        """Points in the pelvis (n, points, 3) and the body that carries each (n, points).

        A point that is not passed lies on the one before it, and moves with that one's body.
        """
        place = np.broadcast_to(
            self.place * np.array([self.size[b] for b in BODIES])[self.body, None], (len(angles), *self.place.shape)
        ).copy()
        for i, spline in self.kneecap:
            place[:, i, :2] = self.size["tibia"] * spline(angles[:, COORDINATES.index("knee_flexion")])
        points = np.einsum("pnkl,npl->npk", turns[self.body], place) + np.swapaxes(origins[self.body], 0, 1)
        carrier = np.tile(self.body, (len(angles), 1))
        for i, j, low, high in self.passed:
            left_out = (angles[:, j] < low) | (angles[:, j] > high)
            points[left_out, i], carrier[left_out, i] = points[left_out, i - 1], carrier[left_out, i - 1]
        return points, carrier

    def _segments(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Direction (n, points, 3) and length (n, points) from each point to the next of its muscle; 0 at the last."""
        ahead = np.zeros_like(points)
        ahead[:, :-1] = points[:, 1:] - points[:, :-1]
        ahead[:, self.first[1:] - 1] = 0.0
        length = np.linalg.norm(ahead, axis=-1)
        return ahead / np.where(length > 0.0, length, 1.0)[..., None], length


@lru_cache(maxsize=4)
def leg_paths(sizes: tuple[tuple[str, float], ...] = ()) -> LegPaths:
    """The paths that ship with the package (tables/SOURCE.md).

    Parameters
    ----------
    sizes
        Factors on bodies, as pairs of name and factor; what is not named is the subject's own.
    """
    rows = read_table("paths.csv")
    names = tuple(dict.fromkeys(row["muscle"] for row in rows))
    owner = [names.index(row["muscle"]) for row in rows]
    carrying = {**{b: k for k, b in enumerate(BODIES)}, "patella": BODIES.index("tibia")}
    passed = tuple(
        (
            i,
            COORDINATES.index(row["joint"]),
            np.radians(float(row["from_deg"] or -np.inf)),
            np.radians(float(row["to_deg"] or np.inf)),
        )
        for i, row in enumerate(rows)
        if row["joint"]
    )
    knee, patella = read_table("knee.csv"), read_table("patella.csv")
    flexion = np.radians([float(row["knee_flexion_deg"]) for row in patella])
    kneecap = []
    for i, row in enumerate(rows):
        if row["body"] == "patella":
            track = [[float(p[f"{row['muscle']}_{axis}_mm"]) / 1e3 for axis in "xy"] for p in patella]
            kneecap.append((i, CubicSpline(flexion, np.array(track))))
    slide = [
        CubicSpline(
            np.radians([float(row["knee_flexion_deg"]) for row in knee if row["direction"] == direction]),
            np.array([float(row["shift_mm"]) / 1e3 for row in knee if row["direction"] == direction]),
        )
        for direction in ("forward", "up")
    ]
    return LegPaths(
        names=names,
        first=np.array([owner.index(k) for k in range(len(names))]),
        body=np.array([carrying[row["body"]] for row in rows]),
        place=np.array([[float(row[f"{axis}_mm"] or 0.0) / 1e3 for axis in "xyz"] for row in rows]),
        passed=passed,
        kneecap=tuple(kneecap),
        slide=(slide[0], slide[1]),
        size={**dict.fromkeys((*BODIES, "talus"), 1.0), **dict(sizes)},
    )
