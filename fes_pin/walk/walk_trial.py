"""A trial of walking: the residual of the ground reaction, and the regressors of its possible causes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fes_pin.walk.dynamics import Motion, about
from fes_pin.walk.motion import Session
from fes_pin.walk.plates import Plates


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
    """

    name: str
    motion: Motion
    plates: Plates
    time: np.ndarray = field(repr=False)
    coordinates: Mapping[str, np.ndarray] = field(repr=False)
    moved: Callable[[np.ndarray, Mapping[str, np.ndarray]], Motion] = field(repr=False)
    read: Callable[..., Plates] = field(repr=False)
    session: Session

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
