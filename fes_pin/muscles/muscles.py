"""The table of muscles: strength, paths over posture, fibres and tendons; the right side, mirrored to the left."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fes_pin.body.joints import JOINT_NAMES, MIRROR_SIGN, RANGE_DEG, SIDES, angles_array, known_joint
from fes_pin.data.errors import InputError
from fes_pin.data.named import NamedArray
from fes_pin.data.numbers import numbers
from fes_pin.data.read_only import ReadOnly
from fes_pin.muscles.fibres import isometric_force, velocity_factor
from fes_pin.muscles.paths import COORDINATES, LegPaths, leg_paths, read_table

KNOWN_DEG = {name: RANGE_DEG[name] for name in COORDINATES} | {
    "hip_flexion": (-30.0, 85.0),
    "knee_flexion": (-10.0, 110.0),
}
"""Angles at which the paths are anatomy: a joint's whole range (`joint_limits`), but for what runs straight where bone
would hold it off. Iliacus and psoas lose the pelvic rim in front of them beyond 85 degrees of hip flexion and would
extend the hip beyond 102; the long biceps would cross in front of the knee beyond 115 degrees of flexion.
"""
BEYOND_DEG = 10.0
"""Distance beyond them at which the arms of the edge are used, with a warning; farther there is no answer."""
ROUNDING = 1e-9
"""Angles no farther outside than this are on the edge, rad."""


def angles_of(q) -> np.ndarray:
    """Joint angles as an array in the order of `JOINT_NAMES`.

    Parameters
    ----------
    q
        By name, rad: a mapping (absent joints are at 0), or a `NamedArray` (..., n) as `Body.angles` gives it. An array
        without names, (..., 19), is in the order of `JOINT_NAMES`, which is no body's. None: the neutral posture.

    Raises
    ------
    InputError
        Unknown joint, wrong shape, or an angle that is not a number.
    """
    if isinstance(q, NamedArray) and q.ndim > 1 and q.names is not None:
        for name in q.names:
            known_joint(name)
        q = q.arranged(JOINT_NAMES)
    elif q is None or hasattr(q, "keys"):
        q = angles_array({} if q is None else q, JOINT_NAMES)
    angles = numbers(q, "joint angles")
    if angles.shape[-1:] != (len(JOINT_NAMES),):
        raise InputError(f"expected {len(JOINT_NAMES)} joint angles, got an array of shape {angles.shape}")
    if not np.isfinite(angles).all():
        name = JOINT_NAMES[int(np.argwhere(~np.isfinite(angles))[0][-1])]
        raise InputError(f"the angle of {name} is not a finite number")
    return angles


@dataclass(frozen=True, eq=False)
class MuscleTable(ReadOnly):
    """Muscles of both sides, in the order of `SIDES`; on each side those of the leg, then those of the trunk.

    Attributes
    ----------
    names, nerves
        One per muscle, with its side: `right_soleus`, `right_tibial`.
    strength, fibre, tendon, pennation
        (m,) largest isometric force of a healthy young man's fibres N, optimal fibre length m, tendon slack length m,
        pennation rad.
    neutral_length
        (m,) length of muscle and tendon at the neutral posture, m.
    legs
        Paths of a right leg's muscles.
    levers
        (m, 19) of the trunk's muscles, constant over posture; 0 for those of the legs.
    lower, upper
        (19,) angles between which the moment arms are known, rad; unlimited where they are constant.
    """

    names: tuple[str, ...]
    nerves: tuple[str, ...]
    strength: np.ndarray
    fibre: np.ndarray
    tendon: np.ndarray
    pennation: np.ndarray
    neutral_length: np.ndarray
    legs: LegPaths
    levers: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    def within(self, q) -> np.ndarray:
        """The posture, (..., 19) rad, held within the angles at which moment arms are known.

        Raises
        ------
        InputError
            An angle more than `BEYOND_DEG` outside; and see `angles_of`.
        """
        angles = angles_of(q)
        inside = np.clip(angles, self.lower, self.upper)
        far = np.argwhere(np.abs(angles - inside) > np.radians(BEYOND_DEG) + ROUNDING)
        if len(far):
            j = int(far[0][-1])
            low, high = np.degrees([self.lower[j], self.upper[j]])
            known = f"moment arms about {JOINT_NAMES[j]} are known from {low:.0f} to {high:.0f} degrees"
            outside = f"{np.degrees(angles[tuple(far[0])]):.0f} is too far outside"
            raise InputError(f"{known}: beyond, the muscles' paths leave the bones; {outside}")
        return inside

    def held(self, q=None) -> tuple[str, ...]:
        """Return the joints held at the edge of the known range, one sentence each (see `Nerves.held`)."""
        angles, inside = (a.reshape(-1, len(JOINT_NAMES)) for a in (angles_of(q), self.within(q)))
        farthest = np.argmax(np.abs(angles - inside), axis=0)
        sentences = []
        for j in np.flatnonzero(np.abs(angles - inside).max(axis=0) > ROUNDING):
            asked, used = np.degrees(angles[farthest[j], j]), np.degrees(inside[farthest[j], j])
            name = JOINT_NAMES[j].replace("_", " ")
            sentences.append(f"moment arms at {name} {asked:.0f} degrees are not known: those at {used:.0f} are used")
        return tuple(sentences)

    def _postures(self, q) -> tuple[np.ndarray, tuple[int, ...]]:
        """Postures (n, 19), and the shape to return to."""
        angles = self.within(q)
        return angles.reshape(-1, len(JOINT_NAMES)), angles.shape[:-1]

    def _legs(self, flat: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, slice]]:
        """Yield for each leg its angles (n, 8), their places among the 19, and those of its muscles."""
        for start, places in zip((0, len(self.names) // 2), LEG_OF.values(), strict=True):
            yield flat[:, places], places, slice(start, start + len(self.legs.names))

    def moment_arms(self, q=None) -> np.ndarray:
        """Moment arms at a posture, m: (..., 19, m) for angles (..., 19)."""
        flat, shape = self._postures(q)
        arms = np.tile(self.levers.T, (len(flat), 1, 1))
        for leg, places, muscles in self._legs(flat):
            arms[:, places, muscles] = self.legs.moment_arms(leg)
        return arms.reshape(*shape, *arms.shape[1:])

    def lengths(self, q=None) -> np.ndarray:
        """Length of muscle and tendon, m: (..., m)."""
        flat, shape = self._postures(q)
        lengths = self.neutral_length - flat @ self.levers.T
        for leg, _, muscles in self._legs(flat):
            lengths[:, muscles] = self.legs.lengths(leg)
        return lengths.reshape(*shape, len(self.names))

    def isometric_fraction(self, q=None) -> np.ndarray:
        """Force along the tendon at rest, 1 is the largest isometric force of the fibres: (..., m)."""
        return isometric_force(self.lengths(q), self.fibre, self.tendon, self.pennation)

    def velocity_fraction(self, q, v) -> np.ndarray:
        """Force-velocity factor, 1 when the joints stand still: (..., m); `v` (..., 19) rad/s. Tendons are rigid."""
        speed = -np.einsum("...jm,...j->...m", self.moment_arms(q), angles_of(v)) / np.cos(self.pennation)
        return velocity_factor(speed / self.fibre)


LEG_OF = {side: np.array([JOINT_NAMES.index(f"{side}_{joint}") for joint in COORDINATES]) for side in SIDES}
"""Places of the angles of a leg's paths among the 19."""


@lru_cache(maxsize=1)
def standard_muscles() -> MuscleTable:
    """The table that ships with the package (see tables/SOURCE.md), both sides."""
    rows, legs = read_table("muscles.csv"), leg_paths()
    names = [row["muscle"] for row in rows]
    levers = np.zeros((2 * len(rows), len(JOINT_NAMES)))
    for row in read_table("trunk.csv"):
        for s, side in enumerate(SIDES):
            sign = MIRROR_SIGN.get(row["joint"], 1.0) if side == "left" else 1.0
            muscle = s * len(rows) + names.index(row["muscle"])
            levers[muscle, JOINT_NAMES.index(row["joint"])] = sign * float(row["lever_mm"]) / 1e3
    known = np.full((len(JOINT_NAMES), 2), [-np.inf, np.inf])
    for j, name in enumerate(JOINT_NAMES):
        known[j] = np.radians(KNOWN_DEG.get(name.split("_", 1)[1], known[j]))
    factor = {row["nerve"]: float(row["factor"]) for row in read_table("strengths.csv")}
    column = {
        key: np.tile([float(row[key]) for row in rows], 2)
        for key in ("strength_N", "fibre_mm", "tendon_mm", "neutral_length_mm", "pennation_deg")
    }
    return MuscleTable(
        names=tuple(f"{side}_{name}" for side in SIDES for name in names),
        nerves=tuple(f"{side}_{row['nerve']}" for side in SIDES for row in rows),
        strength=column["strength_N"] * np.tile([factor[row["nerve"]] for row in rows], 2),
        fibre=column["fibre_mm"] / 1e3,
        tendon=column["tendon_mm"] / 1e3,
        pennation=np.radians(column["pennation_deg"]),
        neutral_length=column["neutral_length_mm"] / 1e3,
        legs=legs,
        levers=levers,
        lower=known[:, 0],
        upper=known[:, 1],
    )
