"""A trial of walking: the measured ground reaction of both feet, its residual, and the regressors of its causes.

Forces are wrenches in our axes, low-passed like the motion.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import distance_transform_edt, find_objects, label

from fes_pin.body.joints import SIDES
from fes_pin.body.skeleton import TO_WORLD
from fes_pin.data.smooth import low_pass
from fes_pin.data.walk_recorded import LOADED_N, level_in_the_air
from fes_pin.walk.motion import Motion, Session, about

ORDINARY_N = 1.5
"""Standard deviation of the force of calibrated plates: its mean errors were 2.5 to 5 N (A. Cappello et al., Gait
Posture 33:724, 2011)."""
SHORTEST_S = 0.1
"""A single support shorter than this is no step."""


@dataclass(frozen=True)
class Plates:
    """Ground reaction of both feet, on one clock.

    Attributes
    ----------
    time
        (n,) s.
    way
        (n, 3) m: the place of the plates relative to a treadmill's belt; zeros over ground.
    feet
        By side, (n, 6): force, N, and moment about the world's origin, N m; x forward, y left, z up.
    pressure
        By side, (n, 3) m: the recorded centre of pressure; held while the plate reads nearly nothing, where it means
        nothing.
    loaded
        By side, (n,) bool: the vertical force is above that of the foot in the air by `LOADED_N`.
    """

    time: np.ndarray = field(repr=False)
    way: np.ndarray = field(repr=False)
    feet: dict[str, np.ndarray] = field(repr=False)
    pressure: dict[str, np.ndarray] = field(repr=False)
    loaded: dict[str, np.ndarray] = field(repr=False)

    @property
    def total(self) -> np.ndarray:
        """Both feet together: (n, 6)."""
        return self.feet["left"] + self.feet["right"]

    def part(self, rows: slice) -> Plates:
        """Some of the samples."""
        cut = ({side: values[rows] for side, values in one.items()} for one in (self.feet, self.pressure, self.loaded))
        return Plates(self.time[rows], self.way[rows], *cut)

    def single_supports(self) -> list[tuple[str, slice]]:
        """Return single supports in the order of time: the foot and its samples."""
        left, right = self.loaded["left"], self.loaded["right"]
        dt = float(self.time[-1] - self.time[0]) / (len(self.time) - 1)
        alone = (("left", left & ~right), ("right", right & ~left))
        found = [(side, rows) for side, where in alone for rows in stretches(where)]
        long = [(side, rows) for side, rows in found if (rows.stop - rows.start) * dt >= SHORTEST_S]
        return sorted(long, key=lambda one: one[1].start)


def stretches(where: np.ndarray) -> list[slice]:
    """Return the stretches of samples in which something holds, in the order of time."""
    return [rows for (rows,) in find_objects(label(where)[0])]


def plates_of(
    time: np.ndarray, columns: Mapping[str, np.ndarray], at: np.ndarray, session: Session, later_s: float = 0.0
) -> Plates:
    """Return the ground reaction at the motion's times; where the plates were not recorded, as at their nearest time.

    Parameters
    ----------
    time, columns
        (m,) s; `r_` and `l_`: `F[xyz]`, `cop[xyz]`, `T[xyz]` as `fes_pin.data.motion.read_ground_reaction` gives them.
    at
        (n,) s; times of the motion.
    session
        Low pass, which forces and moments about the origin go through, and treadmill.
    later_s
        How much later than their clock says the plates are read, s.
    """
    time, dt = time - later_s, float(time[-1] - time[0]) / (len(time) - 1)
    feet, pressure, loaded, total = {}, {}, {}, columns["r_Fy"] + columns["l_Fy"]
    turn = session.turn @ TO_WORLD
    for side in SIDES:
        force, point, free = (
            np.stack([columns[f"{side[0]}_{kind}{c}"] for c in "xyz"], axis=1) @ turn.T for kind in ("F", "cop", "T")
        )
        point = point + session.way(time) @ session.turn.T
        wrench = np.hstack([force, np.cross(point, force) + free])
        smooth = low_pass(wrench, dt, session.cutoff_hz)
        feet[side] = _at(at, time, smooth)
        level = level_in_the_air(force[:, 2], total)
        loaded[side] = _at(at, time, force[:, 2:]).ravel() > LOADED_N + level
        pressure[side] = _held(_at(at, time, point), loaded[side] | (2.0 * abs(level) > LOADED_N))
    return Plates(np.asarray(at, dtype=float), session.way(at) @ session.turn.T, feet, pressure, loaded)


def _at(at: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(at, time, column) for column in values.T], axis=1)


def _held(point: np.ndarray, loaded: np.ndarray) -> np.ndarray:
    """Points of loaded samples; others as at the nearest loaded one in time."""
    if not loaded.any():
        return np.zeros_like(point)
    return point[distance_transform_edt(~loaded, return_distances=False, return_indices=True)[0]]


@dataclass(frozen=True)
class WalkTrial:
    """One trial. Forces in N, moments in N m about the believed centre of mass; x forward, y left, z up.

    Attributes
    ----------
    name
        Of the trial.
    motion, plates
        On one clock; where coordinates are filtered, the filter's ends are cut off.
    time, coordinates
        The coordinates and their clock, as read.
    moved
        Function of times and coordinates of the same session: their motion.
    read
        Function of times, and of how much later than their clock says the plates are read: the plates.
    session
        Low pass and treadmill.
    said
        What was taken otherwise than it was read, a sentence each.
    """

    name: str
    motion: Motion
    plates: Plates
    time: np.ndarray = field(repr=False)
    coordinates: Mapping[str, np.ndarray] = field(repr=False)
    moved: Callable[[np.ndarray, Mapping[str, np.ndarray]], Motion] = field(repr=False)
    read: Callable[..., Plates] = field(repr=False)
    session: Session
    said: tuple[str, ...] = ()

    def read_later(self, later_s: float) -> WalkTrial:
        """Return the trial with the plates read that much later than their clock says."""
        return replace(self, plates=self.read(self.motion.time, later_s=later_s))

    @cached_property
    def needed(self) -> np.ndarray:
        """The reaction that the motion requires: (n, 6)."""
        return about(self.motion.required, self.motion.centre)

    @cached_property
    def residual(self) -> np.ndarray:
        """Measured - required: (n, 6)."""
        return self.measured - self.needed

    @cached_property
    def measured(self) -> np.ndarray:
        """Both feet together: (n, 6)."""
        return about(self.plates.total, self.motion.centre)

    @cached_property
    def load_shares(self) -> dict[str, np.ndarray]:
        """Share of each foot in the vertical load: (n,)."""
        up = {side: np.clip(wrench[:, 2], 0.0, None) for side, wrench in self.plates.feet.items()}
        total = np.maximum(sum(up.values()), 1.0)
        return {side: v / total for side, v in up.items()}

    @cached_property
    def true_feet(self) -> dict[str, np.ndarray]:
        """The reaction of each foot if both together were the required reaction: (n, 6).

        The residual is divided between the feet by their vertical load. A gain error is proportional to this reaction:
        in proportion to the reading, a gain that makes all readings small would make every residual small.
        """
        feet, shares = self.plates.feet, self.load_shares
        return {s: about(feet[s], self.motion.centre) - shares[s][:, None] * self.residual for s in feet}

    @cached_property
    def regressors(self) -> dict[str, np.ndarray]:
        """By segment, (n, 6, 10); see `Motion.regressors`; moments about the believed centre of mass."""
        return {s: about(y, self.motion.centre) for s, y in self.motion.regressors.items()}

    def force_at(self, point: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return the wrench of forces at points: (n, 6); `point` and `force` (n, 3) in the world."""
        along = np.broadcast_to(force, point.shape)
        return np.hstack([along, np.cross(point - self.motion.centre, along)])
