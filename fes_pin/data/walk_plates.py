"""Whose foot stands on which plate of a walk, and the reaction of each foot, whatever plates it steps on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.legs import leg_of
from fes_pin.data.walk_recorded import LOADED_N, SIDES, Arrays, RecordedWalk, level_distance, vectors_of

PLATES = ("right_plates", "left_plates")
"""Keys of `[conventions]` that list plates by the labels of their columns."""
NEARER = 0.6
"""Share of its distance to one foot at which a centre of pressure is the other foot's; one who stands may share it."""


def whose_plates(walk: RecordedWalk) -> None:
    """Which foot stands on which plate; a foot may stand on several, one after the other."""
    chosen = {label: side for key, side in zip(PLATES, SIDES, strict=True) for label in walk.stated.get(key, ())}
    if odd := [label for label in chosen if label not in walk.plates]:
        raise InputError(f"[conventions] states plate {odd[0]}; the file has {', '.join(walk.plates)}")
    if chosen:
        walk.plates = _composed(walk, {label: [(0.0, s)] for label, s in chosen.items()})
    elif set(walk.plates) == set(SIDES):
        _exchanged(walk)
    else:
        _numbered(walk)


def _exchanged(walk: RecordedWalk) -> None:
    """Feet that a file names stand on their own plates."""
    if not walk.long:
        return
    apart = {(label, side): _from_foot(walk, label, side, walk.standing(label)) for label in SIDES for side in SIDES}
    own, cross = (sum(apart[label, side] for label, side in apart if (label == side) is same) for same in (True, False))
    if cross < NEARER * own:
        walk.plates = {"r": walk.plates["l"], "l": walk.plates["r"]}
        walk.said.append("columns of the right foot lie under the left one: the feet are exchanged on reading")


def _numbered(walk: RecordedWalk) -> None:
    """The foot that is nearer by far stands on a plate, step by step."""
    owners: dict[str, list[tuple[float, str]]] = {}
    words = []
    for label in walk.plates:
        steps = []
        for here in walk.steps(label):
            by = {side: _from_foot(walk, label, side, here) for side in SIDES}
            near, far = sorted(by, key=lambda side: by[side])
            times = walk.time[here]
            if by[near] > NEARER * by[far]:
                raise InputError(
                    f"expected columns that name the foot, r_ and l_, or right_plates in [conventions]: whose foot "
                    f"stands on plate {label} at {times[0]:.2f} to {times[-1]:.2f} s does not show"
                )
            steps.append((float(np.mean(times)), near))
        if steps:
            owners[label] = steps
        feet = {SIDES[side] for _, side in steps}
        whose = "is each foot's in turn" if len(feet) > 1 else f"is the {min(feet)} foot's" if feet else "is empty"
        words.append(f"plate {label} {whose}")
    if not owners:
        raise InputError("expected columns that name the foot, r_ and l_: nobody steps on a plate")
    walk.said.append(", ".join(words))
    walk.plates = _composed(walk, owners)


def _from_foot(walk: RecordedWalk, label: str, side: str, rows: np.ndarray) -> float:
    """Mean distance of a centre of pressure from a foot, level, m: the lesser of both signs of the knee."""
    if not rows.any():
        return 0.0
    legs = (leg_of(walk.moves, walk.time, side, knee) for knee in (1.0, -1.0))
    return min(float(np.mean(level_distance(walk.plate(label, "cop")[rows] - leg.sole[rows]))) for leg in legs)


def _composed(walk: RecordedWalk, owners: Mapping[str, Sequence[tuple[float, str]]]) -> dict[str, Arrays]:
    """Both feet's reactions, (m,): all that plates read while they are a foot's; `owners` are feet with times, s."""
    return {side: _summed(list(_stood_on(walk, side, owners)), len(walk.push_time)) for side in SIDES}


def _stood_on(
    walk: RecordedWalk, side: str, owners: Mapping[str, Sequence[tuple[float, str]]]
) -> Iterator[tuple[Arrays, np.ndarray]]:
    """Plates that are a foot's, each with the samples in which it is: those nearest to its steps, (m,) bool."""
    for label, steps in owners.items():
        nearest = np.abs(walk.push_time[:, None] - np.array([at for at, _ in steps])).argmin(axis=1)
        mine = np.array([foot == side for _, foot in steps])[nearest]
        if mine.any():
            yield walk.plates[label], mine


def _summed(parts: Sequence[tuple[Arrays, np.ndarray]], count: int) -> Arrays:
    """The reaction of several plates as of one, (m,): their force, their mean centre of pressure, the moment about it.

    One plate in all samples stays as it is.
    """
    if len(parts) == 1 and parts[0][1].all():
        return parts[0][0]
    force, moment, weigh, point = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count), np.zeros((count, 3))
    read = [[vectors_of(plate, kind) * mine[:, None] for kind in ("F", "cop", "T")] for plate, mine in parts]
    for f, c, _ in read:
        load = np.where(f[:, 1] > LOADED_N, f[:, 1], 0.0)
        force, weigh, point = force + f, weigh + load, point + load[:, None] * c
    point = point / np.maximum(weigh, 1e-9)[:, None]
    for f, c, t in read:
        moment += np.where((f[:, 1] > LOADED_N)[:, None], t + np.cross(c - point, f) * [0.0, 1.0, 0.0], 0.0)
    of = {"F": force, "cop": point, "T": moment}
    return {f"{kind}{c}": values[:, k] for kind, values in of.items() for k, c in enumerate("xyz")}
