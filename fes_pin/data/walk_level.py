"""Axes of a laboratory that are not level, as of a treadmill that slopes: over strides the plates carry the weight.

Coordinates and plates of such a file lie in axes that are turned with the walkway; gravity is along the mean force.
"""

from __future__ import annotations

import numpy as np

from fes_pin.data.legs import origin_of, pelvis_of
from fes_pin.data.walk_recorded import GRAVITY, LOADED_N, RecordedWalk, vectors_of

AXES = ("level", "inclined")
"""What the laboratory's axes may be; the first is the study format's."""
LEANS_RAD = 0.15
"""Angle of the mean force against y from which the axes are inclined: less may be the cause `base_tilt`, whose possible
size this is."""
PUSHED_N = 150.0
"""Mean horizontal force from which they are: less, of a light body, may be the cause `external_force`, whose possible
size this is."""
LONG_S = 2.0
"""s; in less the horizontal force of a stride that is cut off does not cancel out (a stride lasts 1 to 1.3 s)."""
CARRIED = 0.9
"""Share of the time that somebody stands on the plates; who steps next to them has forces that nobody measured."""
WEIGHS = (0.85, 1.15)
"""Mean force over the weight of a known mass: a stated mass may be wrong by as much, and not what pushes or holds."""


def axes_of(walk: RecordedWalk, mass_kg: float | None) -> None:
    """Turn a walk in inclined axes until its mean force is vertical, which is said; say where it may be a push."""
    stated = walk.stated.get("axes")
    if stated == "level" or not (walk.long or stated):
        return
    force, seconds = _mean_force(walk)
    level, up = float(np.hypot(force[0], force[2])), float(force[1])
    if not (up > 0.0 and np.isfinite(force).all()):
        return
    leans = level > np.tan(LEANS_RAD) * up and seconds > LONG_S and _is_weight(walk, force, mass_kg)
    if not (stated or leans):
        return
    angle = f"{np.degrees(np.arctan2(level, up)):.1f} degrees"
    mean = f"over {seconds:.3g} s the plates carry {level:.0f} N horizontally and {up:.0f} N vertically in the mean"
    if stated or level > PUSHED_N:
        _turn(walk, force / np.linalg.norm(force))
        walk.said.append(f"the axes are taken as inclined by {angle}, as of a treadmill that slopes: {mean}")
    else:
        walk.said.append(f"the axes lean by {angle}, or something pushes: {mean}; [conventions] axes says which")


def _mean_force(walk: RecordedWalk) -> tuple[np.ndarray, float]:
    """The mean of all plates' force less what speeds the body up, (3,) N, and over how long, s."""
    rows = walk.rows
    time = walk.time[rows] - walk.time[rows[0]]
    total = np.sum([walk.plate(label, "F")[rows] for label in walk.plates], axis=0).mean(axis=0)
    path = origin_of(walk.moves)[rows]
    speeding = 2.0 * np.polynomial.polynomial.polyfit(time, path, 2)[2]
    return total - np.linalg.norm(total) / GRAVITY * speeding * [1.0, 0.0, 1.0], float(time[-1])


def _is_weight(walk: RecordedWalk, force: np.ndarray, mass_kg: float | None) -> bool:
    """Whether plates carry the body alone, nearly all the time."""
    loaded = np.sum([walk.load(label) for label in walk.plates], axis=0)[walk.rows] > LOADED_N
    share = 1.0 if mass_kg is None else float(np.linalg.norm(force)) / (mass_kg * GRAVITY)
    return float(np.mean(loaded)) > CARRIED and WEIGHS[0] < share < WEIGHS[1]


def _turn(walk: RecordedWalk, vertical: np.ndarray) -> None:
    """Turn coordinates and plates so that a direction, (3,), becomes y; rates of coordinates are left out."""
    axis = np.cross(vertical, [0.0, 1.0, 0.0])
    sine, cosine = float(np.linalg.norm(axis)), float(vertical[1])
    x, y, z = axis / max(sine, 1e-12)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn = np.eye(3) + sine * cross + (1.0 - cosine) * (cross @ cross)
    moves = {n: v for n, v in walk.moves.items() if n.startswith("q_")}
    moves |= dict(zip((f"q_pelvis_t{c}" for c in "xyz"), (origin_of(moves) @ turn.T).T, strict=True))
    pelvis = turn @ pelvis_of(moves)
    angles = {  # of turns about z, x and y, one after the other
        "q_pelvis_tilt": np.arctan2(-pelvis[:, 0, 1], pelvis[:, 1, 1]),
        "q_pelvis_list": np.arcsin(np.clip(pelvis[:, 2, 1], -1.0, 1.0)),
        "q_pelvis_rotation": np.arctan2(-pelvis[:, 2, 0], pelvis[:, 2, 2]),
    }
    full = 2.0 * np.pi
    walk.moves = {**moves, **{n: v + full * np.round((moves[n] - v) / full) for n, v in angles.items()}}
    for plate in walk.plates.values():
        for kind in ("F", "cop", "T"):
            turned = vectors_of(plate, kind) @ turn.T
            plate.update({f"{kind}{c}": turned[:, k] for k, c in enumerate("xyz")})
