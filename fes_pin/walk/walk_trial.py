"""A trial of walking: the residual of the ground reaction, and the regressors of its possible causes."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from fes_pin.walk.dynamics import (
    about,
    centre_of_mass,
    required,
    segment_parameters,
    segment_poses,
    segment_regressors,
)
from fes_pin.walk.motion import Motion
from fes_pin.walk.plates import Plates, plates_of
from fes_pin.walk.recording import WalkRecording


@dataclass(frozen=True)
class WalkTrial:
    """One trial. Forces in N, moments in N m about the believed centre of mass; x forward, y left, z up.

    Attributes
    ----------
    name
        Of the trial.
    motion, plates
        On one clock.
    centre
        (n, 3) m: the believed centre of mass.
    way
        (n, 3) m: the place of the plates relative to a treadmill's belt; zeros over ground.
    """

    name: str
    motion: Motion = field(repr=False)
    plates: Plates = field(repr=False)
    centre: np.ndarray = field(repr=False)
    way: np.ndarray | None = field(default=None, repr=False)

    @cached_property
    def needed(self) -> np.ndarray:
        """The reaction that the motion requires: (n, 6)."""
        return about(required(self.motion), self.centre)

    @cached_property
    def residual(self) -> np.ndarray:
        """Measured - required: (n, 6)."""
        return self.measured - self.needed

    @cached_property
    def measured(self) -> np.ndarray:
        """Both feet together: (n, 6)."""
        return about(self.plates.total, self.centre)

    @cached_property
    def rate(self) -> np.ndarray:
        """How fast the plates' reading changes, about the centre of mass where it is: (n, 6) per s."""
        way = np.zeros_like(self.centre) if self.way is None else self.way
        read = about(self.plates.total, way)
        return about(np.gradient(read, self.dt, axis=0), self.centre - way)

    @cached_property
    def feet(self) -> dict[str, np.ndarray]:
        """Measured reaction of each foot: (n, 6)."""
        return {side: about(wrench, self.centre) for side, wrench in self.plates.feet.items()}

    @cached_property
    def true_feet(self) -> dict[str, np.ndarray]:
        """The reaction of each foot if both together were the required reaction: (n, 6).

        The residual is divided between the feet by their vertical load. A gain error is proportional to this reaction:
        in proportion to the reading, a gain that makes all readings small would make every residual small.
        """
        up = {side: np.clip(wrench[:, 2], 0.0, None) for side, wrench in self.feet.items()}
        total = np.maximum(sum(up.values()), 1.0)
        return {side: wrench - (up[side] / total)[:, None] * self.residual for side, wrench in self.feet.items()}

    @cached_property
    def regressors(self) -> dict[str, np.ndarray]:
        """By segment, (n, 6, 10); see `segment_regressors`."""
        return {s: about(y, self.centre) for s, y in segment_regressors(self.motion).items()}

    @cached_property
    def parameters(self) -> dict[str, np.ndarray]:
        """By segment, (10,): the believed mass parameters."""
        return segment_parameters(self.motion)

    @cached_property
    def poses(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Every segment's orientation and origin; see `segment_poses`."""
        return segment_poses(self.motion)

    @property
    def dt(self) -> float:
        """Time step, s."""
        return self.motion.dt

    def force_at(self, point: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Return the wrench of 1 N along world directions at points: (n, 6); `point`, `direction` (n, 3)."""
        along = np.broadcast_to(direction, point.shape)
        return np.hstack([along, np.cross(point - self.centre, along)])


def walk_trial_of(recording: WalkRecording, cutoff_hz: float, later_s: float = 0.0) -> WalkTrial:
    """Return a recording as a trial; `later_s` reads the plates that much later than their clock says."""
    plates = recording.plates
    if later_s:
        time = recording.raw_time - later_s
        held = np.clip(recording.motion.time, time[0], time[-1])
        plates = plates_of(
            time, recording.raw_plates, held, cutoff_hz=cutoff_hz, belt_speed_mps=recording.belt_speed_mps,
            start_s=recording.start_s,
        )  # fmt: skip
    way = np.outer(recording.belt_speed_mps * (recording.motion.time - recording.start_s), [1.0, 0.0, 0.0])
    return WalkTrial(recording.name, recording.motion, plates, centre_of_mass(recording.motion), way)
