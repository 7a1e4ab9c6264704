"""Coordinates of a walk: units of angles and lengths, signs of knees and ankles, by where a standing foot would be."""

from __future__ import annotations

import itertools

import numpy as np

from fes_pin.data.checks import TURN
from fes_pin.data.legs import Leg, leg_of, pelvis_of
from fes_pin.data.motion import coordinates_unwrapped, in_radians, is_angle, joints_turned, knees_bend_positively
from fes_pin.data.walk_recorded import SIDES, Arrays, RecordedWalk, level_distance

LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
KNEES = {"negative": 1.0, "positive": -1.0}
"""How a knee may count its flexion, and the factor that makes it negative."""
FAR_M, NEAR_M = 1.5, 0.3
"""No centre of pressure lies further from the feet than the first, level; in walks they lie within 0.07 to 0.17 of
them, root mean square, and within the second also where a knee has the other sign."""
HIGHEST_M = 10.0
"""No pelvis is so high, m: translations are in another unit."""
WIDER = 1.2
"""Factor by which standing feet wander from their centres of pressure in one unit of angles that shows the other: in
walks 1.4 to 1.7."""
CLEAR = np.log(20.0)
"""Log-likelihood ratio from which a knee's sign is decided: 20 to 1."""
UNUSUAL = np.log(100.0)
"""Prior log-odds against two knees of one file that count differently: a model has one sign for both."""
ANKLES = {"positive": 1.0, "negative": -1.0}
"""How an ankle may count its dorsiflexion, and the factor that makes it positive."""
FLAT, RESTS = 0.25, 0.05
"""Share of a stance in which its foot lies flat, at least, and what it turns then all the same, rad/s."""
FLATTER = 1.5
"""Factor by which flat feet turn faster with one sign of their ankle that shows the other. In made walks, slow to fast,
a wrong sign gives 1.6 to 9.8, a right one 0.10 to 0.63, also of people who limp. Of feet that point down it is 1.3 to
5.4 and 0.18 to 0.75, of ankles that hardly move 0.95 to 1.75 and 0.57 to 1.05: some of these stay as they are
(`scripts/recorded walks --count 60 --seed 71800 --ankles`)."""


def units_of_motion(walk: RecordedWalk, in_degrees: bool) -> None:
    """Angles in rad without jumps, translations in m."""
    high = float(np.abs(np.median(walk.moves["q_pelvis_ty"])))
    unit = walk.stated.get("translation_unit")
    if unit is None and high > HIGHEST_M:
        unit = "mm" if high * LENGTHS["cm"] > HIGHEST_M / 4.0 else "cm"
        walk.said.append(f"translations of the pelvis are taken as {unit}: as m it is {high:.3g} m high")
    factor = LENGTHS[unit or "m"]
    walk.moves = {n: v if is_angle(n) else factor * v for n, v in walk.moves.items()}
    other = not in_degrees
    if "angle_unit" in walk.stated:
        in_degrees = walk.stated["angle_unit"] == "deg"
    elif _is_other_unit(walk, in_degrees):
        in_degrees, words = other, ("degrees", "rad") if other else ("rad", "degrees")
        walk.said.append(f"angles are taken as {words[0]}: as {words[1]} its legs do not reach its feet")
    walk.moves, jumped = coordinates_unwrapped(in_radians(walk.moves, in_degrees))
    if jumped:
        names = ", ".join(n.removeprefix("q_") for n in jumped)
        walk.said.append(f"{names} jumps by a turn of 360 degrees: it is unwrapped")


def _is_other_unit(walk: RecordedWalk, in_degrees: bool) -> bool:
    """Whether the legs reach their feet in the other unit of angles alone."""
    legs = [n for n in walk.moves if n.startswith(("q_hip", "q_knee", "q_ankle"))]
    most = max(float(np.abs(walk.moves[n]).max()) for n in legs)
    if not in_degrees and most > TURN:
        return True  # no joint turns so far
    if (in_degrees and most > TURN) or not walk.long:
        return False
    now, then = (_wandering(walk, in_radians(walk.moves, unit)) for unit in (in_degrees, not in_degrees))
    return now > WIDER * then > 0.0 and _apart(walk, 1.0, in_radians(walk.moves, not in_degrees)) < NEAR_M


def _wandering(walk: RecordedWalk, moves: Arrays) -> float:
    """How far centres of pressure wander from an ankle in a step, m, in the mean: the least of both feet's."""
    moves = coordinates_unwrapped(moves)[0]
    heading = _heading(pelvis_of(moves))
    legs = [leg_of(moves, walk.time, side, knee) for side in SIDES for knee in KNEES.values()]
    steps = [(walk.plate(label, "cop"), on) for label in walk.plates for on in walk.steps(label)]
    return float(np.mean([min(_wandered(point, leg, heading, on) for leg in legs) for point, on in steps] or [0.0]))


def unit_of_pressure(walk: RecordedWalk) -> None:
    """Centres of pressure in m: under the feet."""
    unit = walk.stated.get("pressure_unit")
    if unit:
        walk.scale("cop", LENGTHS[unit])
    if unit or not walk.long:
        return
    apart = {name: _apart(walk, factor, walk.moves) for name, factor in LENGTHS.items()}
    best = min(apart, key=lambda name: apart[name])
    if apart["m"] > FAR_M and apart[best] < NEAR_M:
        walk.scale("cop", LENGTHS[best])
        walk.said.append(f"centres of pressure are taken as {best}: as m they lie {apart['m']:.3g} m from the feet")


def _apart(walk: RecordedWalk, factor: float, moves: Arrays) -> float:
    """Root mean square distance, level, of centres of pressure from the nearer foot, m."""
    legs = [leg_of(moves, walk.time, side) for side in SIDES]
    found = []
    for label in walk.plates:
        on = walk.standing(label)
        point = factor * walk.plate(label, "cop")[on]
        found.append(np.min([level_distance(point - leg.sole[on]) for leg in legs], axis=0))
    return float(np.sqrt(np.mean(np.concatenate(found) ** 2))) if any(map(len, found)) else 0.0


def signs_of_knees(walk: RecordedWalk) -> None:
    """Flexion negative: with the other sign a foot that stands would move, and leave its centre of pressure."""
    stated = {s: KNEES.get(walk.stated.get(f"knee_flexion_{side}", "")) for s, side in SIDES.items()}
    costs = {s: {k: _unrest(walk, s, k) if walk.long else 0.0 for k in KNEES.values()} for s in SIDES}
    both = knees_bend_positively(walk.moves)

    def cost(pair: tuple[float, float]) -> float:
        mixed = UNUSUAL if pair[0] != pair[1] else 0.0
        usual = CLEAR if both != (pair == (-1.0, -1.0)) else 0.0
        return sum(costs[s][k] for s, k in zip(SIDES, pair, strict=True)) + mixed + usual

    right, left = (tuple(KNEES.values()) if sign is None else (sign,) for sign in stated.values())
    likeliest = min(itertools.product(right, left), key=cost)
    bent = [s for s, k in zip(SIDES, likeliest, strict=True) if k < 0.0]
    walk.moves = joints_turned(walk.moves, "knee", bent)
    if told := [SIDES[s] for s in bent if stated[s] is None]:
        knees = "both knees count" if len(told) == 2 else f"the {told[0]} knee counts"
        walk.said.append(f"{knees} flexion positive: taken with the other sign")


def signs_of_ankles(walk: RecordedWalk) -> None:
    """Dorsiflexion positive: with the other sign a foot that lies flat would turn, as the shank turns over it."""
    stated = {s: ANKLES.get(walk.stated.get(f"dorsiflexion_{side}", "")) for s, side in SIDES.items()}
    odds = {s: flatter(walk, s) if walk.long and sign is None else 0.0 for s, sign in stated.items()}
    is_both = min(odds.values()) > 0.0 and sum(odds.values()) > 2.0 * np.log(FLATTER)
    told = [s for s in SIDES if odds[s] > np.log(FLATTER) or (is_both and stated[s] is None)]
    walk.moves = joints_turned(walk.moves, "ankle", [*told, *(s for s in SIDES if stated[s] == -1.0)])
    if told:
        ankles = "both ankles count" if len(told) == 2 else f"the {SIDES[told[0]]} ankle counts"
        walk.said.append(f"{ankles} dorsiflexion negative: taken with the other sign")


def flatter(walk: RecordedWalk, side: str) -> float:
    """Logarithm of how much faster a foot turns while it lies flat than with the other sign of its ankle."""
    on = walk.standing(side)
    if not on.any():
        return 0.0
    both = (walk.moves, joints_turned(walk.moves, "ankle", side))
    across = pelvis_of(walk.moves)[on][:, :, 2]  # whichever way the body walks
    spins = [np.abs(np.sum(leg_of(moves, walk.time, side).spin[on] * across, axis=1)) for moves in both]
    now, then = (float(np.quantile(spin, FLAT)) + RESTS for spin in spins)
    return float(np.log(now / then))


def _unrest(walk: RecordedWalk, side: str, knee: float) -> float:
    """Minus the log-likelihood that a foot stands still under its centre of pressure, by what it scatters."""
    from fes_pin.data.smooth import CUTOFF_HZ  # noqa: PLC0415 - scipy

    on, leg = walk.standing(side), leg_of(walk.moves, walk.time, side, knee)
    if not on.any():
        return 0.0
    arm = walk.plate(side, "cop") - leg.ankle
    still = (leg.velocity + np.cross(leg.spin, arm))[on][:, [0, 2]]
    scatter = np.log(np.sqrt(np.sum(np.var(still, axis=0))) + 1e-3)
    scatter += np.log(_wandered(walk.plate(side, "cop"), leg, _heading(pelvis_of(walk.moves)), on) + 1e-3)
    seconds = float(np.sum(on)) * float(walk.time[-1] - walk.time[0]) / (len(walk.time) - 1)
    return 2.0 * CUTOFF_HZ * seconds * float(scatter)


def _heading(pelvis: np.ndarray) -> np.ndarray:
    """Level directions ahead and to the right of a pelvis: (n, 2, 2) in x and z."""
    ahead = pelvis[:, [0, 2], 0]
    ahead = ahead / np.maximum(np.linalg.norm(ahead, axis=1), 1e-9)[:, None]
    return np.stack([ahead, np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)], axis=1)


def _wandered(point: np.ndarray, leg: Leg, heading: np.ndarray, on: np.ndarray) -> float:
    """How far a centre of pressure wanders from an ankle, as the walker sees it, m."""
    seen = np.einsum("nij,nj->ni", heading[on], (point - leg.ankle)[on][:, [0, 2]])
    return float(np.sqrt(np.sum(np.var(seen, axis=0))))
