"""Forces and moments of the plates under a walk: their units, whether they act on the foot, and about which point.

The plates carry the body; a horizontal force leans towards it; the sole of a foot gives no moment but a small twist.
"""

from __future__ import annotations

import numpy as np

from fes_pin.data.legs import origin_of
from fes_pin.data.walk_recorded import FEWEST, GRAVITY, LOADED_N, SIDES, STANDS, RecordedWalk, vectors_of

ON = {"foot": 1.0, "ground": -1.0}
"""What a force or moment may act on, and the factor that makes it the one on the foot."""
FORCES = {"N": 1.0, "kN": 1000.0}
MOMENTS = {"N m": 1.0, "N mm": 0.001, "kN m": 1000.0}
MOMENTS_ON = "moments_on"
"""Key of the convention that only the whole body's motion shows: `fes_pin.walk.recording` tests it."""
PERSON_KG, CARRIED = (3.0, 400.0), (0.2, 3.0)
"""Masses between which a body is, kg: an infant's and the heaviest's; share of a known mass that plates may carry in
the mean: a walker may step next to them, and a stated mass be wrong."""
SHEARS = 0.5
"""Correlation of a horizontal force with the direction to the body that shows its sign; that of walks is 0.8 to 1."""
TWISTS_M = 0.3
"""m; a foot's free moment over its load is below a tenth of this: friction times some centimetres."""
TIPS_M, EXPLAINED = 0.01, 0.99
"""Horizontal moments over the load, m, that no plate has about a centre of pressure; share of them that a point
must explain about which they are given."""


def sign_and_unit_of_forces(walk: RecordedWalk, mass_kg: float | None) -> None:
    """Reaction, not action; N, not kN."""
    total = float(np.mean(sum(p["Fy"] for p in walk.plates.values())))
    if "force_unit" in walk.stated:
        walk.scale("F", FORCES[walk.stated["force_unit"]])
    elif walk.long and _is_person(1000.0 * abs(total), mass_kg) and not _is_person(abs(total), mass_kg):
        walk.scale("F", FORCES["kN"])
        walk.said.append(f"forces are taken as kN: the plates carry {abs(total):.3g} in the mean")
    if "fy_on" in walk.stated:
        walk.scale("Fy", ON[walk.stated["fy_on"]])
    elif walk.long and _is_person(-1000.0 * total if walk.said else -total, mass_kg):
        for kind in ("F", "T"):
            walk.scale(kind, -1.0)
        walk.said.append(
            f"the plates' forces are taken as those on the ground, with the other sign: the mean vertical force is "
            f"{total:.3g}"
        )


def signs_of_shears(walk: RecordedWalk) -> None:
    """A horizontal force points from the centre of pressure towards the body."""
    for axis, c in ((0, "x"), (2, "z")):
        key = f"f{c}_on"
        if key in walk.stated:
            walk.scale(f"F{c}", ON[walk.stated[key]])
        elif walk.long and _leans(walk, axis) < -SHEARS:
            walk.scale(f"F{c}", -1.0)
            walk.said.append(f"forces along {c} are taken with the other sign: they point away from the body")


def _leans(walk: RecordedWalk, axis: int) -> float:
    """Correlation of a horizontal force with the load times the way from its centre of pressure to the body."""
    force, way = np.zeros(len(walk.time)), np.zeros(len(walk.time))
    for side in SIDES:
        on = walk.standing(side)
        force += on * walk.plate(side, "F")[:, axis]
        way += on * walk.load(side) * (origin_of(walk.moves) - walk.plate(side, "cop"))[:, axis]
    return _correlation(force[walk.rows], way[walk.rows])


def moments(walk: RecordedWalk) -> None:
    """Moments about the centre of pressure, in N m, on the foot."""
    about = walk.stated.get("moments_about")
    if about != "pressure" and (walk.long or about):
        for side in SIDES:
            _moved_to_pressure(walk, side, about is not None)
    unit = walk.stated.get("moment_unit")
    if unit:
        walk.scale("T", MOMENTS[unit])
    elif walk.long and (twist := _twist(walk)) > TWISTS_M:
        for name in ("N mm", "kN m"):
            if 1e-5 * TWISTS_M < twist * MOMENTS[name] < TWISTS_M:
                walk.scale("T", MOMENTS[name])
                walk.said.append(f"moments are taken as {name}: as N m they are {twist:.3g} m times the load")
                break
    walk.scale("T", ON[walk.stated.get(MOMENTS_ON, "foot")])


def _twist(walk: RecordedWalk) -> float:
    """Free moments over the load, m, root mean square."""
    moment, load = 0.0, 0.0
    for side in SIDES:
        on = walk.standing(side)
        moment += float(np.sum(walk.plate(side, "T")[on, 1] ** 2))
        load += float(np.sum(walk.load(side)[on] ** 2))
    return float(np.sqrt(moment / load)) if load else 0.0


def _moved_to_pressure(walk: RecordedWalk, side: str, stated: bool) -> None:
    """Moments about a point of the plate, which they show by themselves, moved to the centre of pressure."""
    plate = walk.plates[side]
    force, point, moment = (vectors_of(plate, kind) for kind in ("F", "cop", "T"))
    on = force[:, 1] > max(STANDS * force[:, 1].max(), LOADED_N)
    level = moment[on][:, [0, 2]]
    if (
        np.sum(on) < FEWEST
        or not np.isfinite(force + point + moment).all()
        or (not stated and np.sqrt(np.mean(level**2)) < TIPS_M * np.mean(force[on, 1]))
    ):
        return
    fx, fy, fz = force[on].T
    arm = np.cross(point[on], force[on])[:, [0, 2]]
    # (cop - o) x F: its x is arm - (oy Fz - oz Fy), its z is arm - (ox Fy - oy Fx)
    zero = 0.0 * fx
    design = np.concatenate([np.stack([zero, fz, -fy], axis=1), np.stack([fy, -fx, zero], axis=1)])
    for unit, factor in MOMENTS.items():
        left = (arm - factor * level).T.ravel()
        if not (np.isfinite(left).all() and np.isfinite(design).all()):
            continue
        origin = np.linalg.lstsq(design, left, rcond=None)[0]
        rest = left - design @ origin
        if not np.sum(rest**2) < (1.0 - EXPLAINED) * np.sum((factor * level) ** 2) < np.inf:
            continue
        free = factor * moment - np.cross(point - origin, force)
        plate.update(Tx=0.0 * free[:, 1], Ty=np.where(force[:, 1] > LOADED_N, free[:, 1], 0.0), Tz=0.0 * free[:, 1])
        where = ", ".join(f"{v:.3g}" for v in origin)
        walk.said.append(
            f"moments of the {SIDES[side]} plate, in {unit}, are about the point ({where}) m: moved to the centre "
            "of pressure"
        )
        return


def _is_person(weight_n: float, mass_kg: float | None) -> bool:
    """Whether a mean vertical force may be that of the body."""
    least, most = PERSON_KG if mass_kg is None else (share * mass_kg for share in CARRIED)
    return least < weight_n / GRAVITY < most


def _correlation(one: np.ndarray, other: np.ndarray) -> float:
    """Correlation of two signals, (n,), that are 0 where they mean nothing; 0 of one that is 0 throughout."""
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return float(one @ other) / size if size else 0.0
