"""How well the body's joints can follow measured walking: markers that should ride on its segments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from fes_pin.body.joints import SEGMENT_NAMES
from fes_pin.data.markers import Markers
from fes_pin.walk.motion import TO_WORLD, Motion


@dataclass(frozen=True)
class MarkerMisfit:
    """A marker, the segment that it rides on best, and how far it moves on it, rms m (soft tissue, joints, cameras)."""

    marker: str
    segment: str
    rms_m: float


def segment_poses(motion: Motion) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Every segment's link frame: orientation (n, 3, 3) and origin (n, 3) m in the world."""
    model, data = motion.model, motion.model.createData()
    frames = {s: model.getFrameId(s) for s in SEGMENT_NAMES}
    turn = {s: np.empty((len(motion.time), 3, 3)) for s in frames}
    origin = {s: np.empty((len(motion.time), 3)) for s in frames}
    for k, q in enumerate(motion.q):
        pin.framesForwardKinematics(model, data, q)
        for s, frame in frames.items():
            turn[s][k], origin[s][k] = data.oMf[frame].rotation, data.oMf[frame].translation
    return {s: (turn[s], origin[s]) for s in frames}


def marker_misfit(motion: Motion, markers: Markers, belt_speed_mps: float = 0.0) -> list[MarkerMisfit]:
    """How far each marker moves on the segment that it rides on best.

    Nothing is said to it of which marker is where: of the ten segments, that on which it moves least is taken. A marker
    on the arms has no segment of its own here, and shows it.

    Parameters
    ----------
    motion
        The motion.
    markers
        In OpenSim's axes, on the motion's clock.
    belt_speed_mps
        As the motion was read with.
    """
    inside = (motion.time >= markers.time[0]) & (motion.time <= markers.time[-1])
    part = motion.part(inside)
    poses = segment_poses(part)
    belt = np.zeros((len(part.time), 3))
    belt[:, 0] = belt_speed_mps * (part.time - motion.time[0])
    out = []
    for name, places in markers.places.items():
        seen = np.isfinite(places).all(axis=1)
        if seen.sum() < 3:
            continue
        world = np.stack([np.interp(part.time, markers.time[seen], c) for c in places[seen].T], axis=1)
        world = world @ TO_WORLD.T + belt
        moved = {}
        for segment, (turn, origin) in poses.items():
            local = np.einsum("nji,nj->ni", turn, world - origin)
            moved[segment] = float(np.sqrt(np.mean(np.sum((local - local.mean(axis=0)) ** 2, axis=1))))
        best = min(moved, key=lambda s: moved[s])
        out.append(MarkerMisfit(name, best, moved[best]))
    return out
