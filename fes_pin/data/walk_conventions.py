"""Conventions of a recorded walk, tested: units and signs of its coordinates and plates, and whose plate is which.

The test is that a foot which stands has its centre of pressure below its sole, and moves with the ground alone. What is
stated is kept; else a file is taken as the study format has it, unless another convention is unmistakable, which is
said.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from fes_pin.data.errors import InputError, KeyFault
from fes_pin.data.legs import Leg, leg_of, origin_of, pelvis_of
from fes_pin.data.motion import PLATE, coordinates_unwrapped, in_radians, is_angle, knees_bend_positively
from fes_pin.data.schema import check_known, one_of

Arrays = dict[str, np.ndarray]
SIDES = {"r": "right", "l": "left"}
ON = ("foot", "ground")
LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
FORCES = {"N": 1.0, "kN": 1000.0}
MOMENTS = {"N m": 1.0, "N mm": 0.001, "kN m": 1000.0}
WORDS: Mapping[str, Sequence[str]] = {
    **{f"knee_flexion_{side}": ("negative", "positive") for side in SIDES.values()},
    "angle_unit": ("rad", "deg"),
    "translation_unit": tuple(LENGTHS),
    "pressure_unit": tuple(LENGTHS),
    "force_unit": tuple(FORCES),
    "moment_unit": tuple(MOMENTS),
    **{f"{what}_on": ON for what in ("fx", "fy", "fz", "moments")},
    "moments_about": ("pressure", "origin"),
}
"""Keys of `[conventions]` and what each may be; the first is how the study format has it."""
PLATES = ("right_plates", "left_plates")
"""Keys of `[conventions]` that list plates by the labels of their columns."""
MOMENTS_ON = "moments_on"
"""Key of the convention that only the whole body's motion shows: `fes_pin.walk.recording` tests it."""
STANDARD = {key: words[0] for key, words in WORDS.items() if key != MOMENTS_ON} | {PLATES[0]: ["r"], PLATES[1]: ["l"]}
"""Conventions of files that the package writes."""

ENOUGH_S, FEWEST = 0.3, 10
"""s and samples; of less nothing is tested (a single support lasts 0.4 s)."""
STANDS = 0.2
"""Share of its largest vertical force above which a foot counts as standing: its centre of pressure is exact there."""
LOADED_N = 20.0
"""A foot stands where its vertical force is above this: the usual threshold on instrumented treadmills."""
SWINGS = 0.2
"""Share of the time that a foot which steps is in the air, at least: it swings for 0.4 of a stride (J. Perry, Gait
Analysis, 1992). The load of one who sways by a quarter of the weight each way is within `LOADED_N` of its least for
less than 0.16."""
LEAST = 0.05
"""Quantile that is taken as the least reading: a few samples may be spikes (a round figure)."""
NEARER = 0.6
"""Share of its distance to one foot at which a centre of pressure is the other foot's; one who stands may share it."""
FAR_M, NEAR_M = 1.5, 0.3
"""No centre of pressure lies further from the feet than the first, level; in walks they lie within 0.07 to 0.17 of
them, root mean square, and within the second also where a knee has the other sign."""
HIGHEST_M = 10.0
"""No pelvis is so high, m: translations are in another unit."""
PERSON_KG, CARRIED = (3.0, 400.0), (0.2, 3.0)
"""Masses between which a body is, kg: an infant's and the heaviest's; share of a known mass that plates may carry in
the mean: a walker may step next to them, and a stated mass be wrong."""
TURN = 2.0 * np.pi
WIDER = 1.2
"""Factor by which standing feet wander from their centres of pressure in one unit of angles that shows the other: in
walks 1.4 to 1.7."""
CLEAR = np.log(20.0)
"""Log-likelihood ratio from which a knee's sign is decided: 20 to 1."""
UNUSUAL = np.log(100.0)
"""Prior log-odds against two knees of one file that count differently: a model has one sign for both."""
SHEARS = 0.5
"""Correlation of a horizontal force with the direction to the body that shows its sign; that of walks is 0.8 to 1."""
TWISTS_M = 0.3
"""m; a foot's free moment over its load is below a tenth of this: friction times some centimetres."""
TIPS_M, EXPLAINED = 0.01, 0.99
"""Horizontal moments over the load, m, that no plate has about a centre of pressure; share of them that a point
must explain about which they are given."""


def checked_conventions(table: Mapping[str, Any], error: KeyFault) -> dict[str, Any]:
    """What a table `[conventions]` states, by key.

    Raises
    ------
    InputError
        Made by `error`, for an unknown key or word, or plates that are no list of labels.
    """
    check_known(table, (*WORDS, *PLATES), error)
    out: dict[str, Any] = {}
    for key, value in table.items():
        if key in WORDS:
            out[key] = one_of(value, tuple(WORDS[key]), partial(error, key))
        elif isinstance(value, list) and all(isinstance(v, str | int) and len(str(v)) == 1 for v in value):
            out[key] = [str(v) for v in value]
        else:
            raise error(key, "expected a list of plates: their numbers, r or l")
    return out


def conventional(
    time: np.ndarray,
    coordinates: Mapping[str, np.ndarray],
    in_degrees: bool,
    push_time: np.ndarray,
    plates: Mapping[str, Mapping[str, np.ndarray]],
    stated: Mapping[str, Any] | None = None,
    mass_kg: float | None = None,
) -> tuple[Arrays, Arrays, tuple[str, ...]]:
    """A walk as the study format has it, whatever conventions its files follow.

    Parameters
    ----------
    time, coordinates
        (n,) s; `q_<coordinate>` and rates, (n,), as the file has them.
    in_degrees
        What the file says of its angles.
    push_time, plates
        (m,) s; by plate `Fx` ... `copx` ... `Tz`, (m,): see `fes_pin.data.motion.plates_in`.
    stated
        Conventions that the study states; see `checked_conventions`.
    mass_kg
        Of the body, if it is known.

    Returns
    -------
    coordinates
        rad and m, knees with flexion negative, angles without jumps.
    reaction
        `r_` and `l_` `Fx` ... `Tz`: N, m, N m about the centre of pressure, on the foot.
    said
        What was taken otherwise than the format has it, a sentence each.

    Raises
    ------
    InputError
        Plates are numbered, and whose foot stands on one is not shown.
    """
    walk = _Walk(time, dict(coordinates), push_time, {k: dict(v) for k, v in plates.items()}, dict(stated or {}))
    with np.errstate(all="ignore"):  # numbers that nobody measured may overflow; no test is passed by them
        walk.sign_and_unit_of_forces(mass_kg)
        walk.units_of_motion(in_degrees)
        walk.unit_of_pressure()
        walk.whose_plates()
        walk.signs_of_knees()
        walk.signs_of_shears()
        walk.moments()
    return walk.moves, {f"{s}_{kind}": v for s in SIDES for kind, v in walk.plates[s].items()}, tuple(walk.said)


class _Walk:
    """A walk while its conventions are tested, one after the other."""

    def __init__(self, time: np.ndarray, moves: Arrays, push_time: np.ndarray, plates: dict[str, Arrays],
                 stated: dict[str, Any]) -> None:  # fmt: skip
        self.time, self.moves, self.push_time, self.plates, self.stated = time, moves, push_time, plates, stated
        self.said: list[str] = []
        both = (time >= push_time[0]) & (time <= push_time[-1])
        self.rows = np.flatnonzero(both)
        self.long = len(self.rows) >= FEWEST and float(time[self.rows[-1]] - time[self.rows[0]]) >= ENOUGH_S

    # what is read of it -----------------------------------------------------------------------------------------------

    def plate(self, label: str, kind: str) -> np.ndarray:
        """A vector of a plate at the motion's times: (n, 3)."""
        columns = (self.plates[label][f"{kind}{c}"] for c in "xyz")
        return np.stack([np.interp(self.time, self.push_time, c) for c in columns], axis=1)

    def load(self, label: str) -> np.ndarray:
        """A plate's vertical force at the motion's times, less what it reads in the air: (n,), 0 where it has none."""
        up = self.plates[label]["Fy"]
        level = level_in_the_air(up, np.sum([p["Fy"] for p in self.plates.values()], axis=0))
        load = np.interp(self.time, self.push_time, up - level)
        within = np.isin(np.arange(len(self.time)), self.rows)
        return np.where(within & (load > LOADED_N), load, 0.0)

    def standing(self, label: str) -> np.ndarray:
        """Samples in which somebody stands on a plate: (n,) bool; none of one that carries too little."""
        load = self.load(label)
        on = load > STANDS * load.max()
        return on if np.sum(on) >= FEWEST else np.zeros(len(on), dtype=bool)

    def steps(self, label: str) -> Iterator[np.ndarray]:
        """Samples of each stance on a plate: (n,) bool."""
        on = self.standing(label)
        ends = np.flatnonzero(np.diff(np.r_[False, on, False].astype(int)))
        rows = np.arange(len(on))
        for start, stop in zip(ends[::2], ends[1::2], strict=True):
            if stop - start >= FEWEST // 2:
                yield (rows >= start) & (rows < stop)

    def turned(self, names: Sequence[str]) -> None:
        """Give coordinates, and their rates, the other sign."""
        for name in names:
            for kind in ("q", "qd", "qdd"):
                if f"{kind}_{name}" in self.moves:
                    self.moves[f"{kind}_{name}"] = -self.moves[f"{kind}_{name}"]

    def scale(self, kinds: str, factor: float) -> None:
        """Scale columns of all plates: `F`, `cop` or `T`, or one of them with its axis."""
        for plate in self.plates.values():
            for name in plate:
                if name.startswith(kinds):
                    plate[name] = factor * plate[name]

    # forces -----------------------------------------------------------------------------------------------------------

    def sign_and_unit_of_forces(self, mass_kg: float | None) -> None:
        """Reaction, not action; N, not kN."""
        total = float(np.mean(sum(p["Fy"] for p in self.plates.values())))
        if "force_unit" in self.stated:
            self.scale("F", FORCES[self.stated["force_unit"]])
        elif self.long and _is_person(1000.0 * abs(total), mass_kg) and not _is_person(abs(total), mass_kg):
            self.scale("F", FORCES["kN"])
            self.said.append(f"forces are taken as kN: the plates carry {abs(total):.3g} in the mean")
        if "fy_on" in self.stated:
            self.scale("Fy", 1.0 if self.stated["fy_on"] == "foot" else -1.0)
        elif self.long and _is_person(-1000.0 * total if self.said else -total, mass_kg):
            for kind in ("F", "T"):
                self.scale(kind, -1.0)
            self.said.append(
                f"the plates' forces are taken as those on the ground, with the other sign: the mean vertical force is "
                f"{total:.3g}"
            )

    def signs_of_shears(self) -> None:
        """A horizontal force points from the centre of pressure towards the body."""
        for axis, c in ((0, "x"), (2, "z")):
            key = f"f{c}_on"
            if key in self.stated:
                self.scale(f"F{c}", 1.0 if self.stated[key] == "foot" else -1.0)
            elif self.long and self._leans(axis) < -SHEARS:
                self.scale(f"F{c}", -1.0)
                self.said.append(f"forces along {c} are taken with the other sign: they point away from the body")

    def _leans(self, axis: int) -> float:
        """Correlation of a horizontal force with the load times the way from its centre of pressure to the body."""
        force, way = np.zeros(len(self.time)), np.zeros(len(self.time))
        for side in SIDES:
            on = self.standing(side)
            force += on * self.plate(side, "F")[:, axis]
            way += on * self.load(side) * (origin_of(self.moves) - self.plate(side, "cop"))[:, axis]
        return _correlation(force[self.rows], way[self.rows])

    def moments(self) -> None:
        """Moments about the centre of pressure, in N m, on the foot."""
        about = self.stated.get("moments_about")
        for side in SIDES if self.long or about else ():
            if about != "pressure":
                self._moved_to_pressure(side, about is not None)
        unit = self.stated.get("moment_unit")
        if unit:
            self.scale("T", MOMENTS[unit])
        elif self.long and (twist := self._twist()) > TWISTS_M:
            for name in ("N mm", "kN m"):
                if 1e-5 * TWISTS_M < twist * MOMENTS[name] < TWISTS_M:
                    self.scale("T", MOMENTS[name])
                    self.said.append(f"moments are taken as {name}: as N m they are {twist:.3g} m times the load")
                    break
        if self.stated.get(MOMENTS_ON) == "ground":
            self.scale("T", -1.0)

    def _twist(self) -> float:
        """Free moments over the load, m, root mean square."""
        moment, load = 0.0, 0.0
        for side in SIDES:
            on = self.standing(side)
            moment += float(np.sum(self.plate(side, "T")[on, 1] ** 2))
            load += float(np.sum(self.load(side)[on] ** 2))
        return float(np.sqrt(moment / load)) if load else 0.0

    def _moved_to_pressure(self, side: str, stated: bool) -> None:
        """Moments about a point of the plate, which they show by themselves, moved to the centre of pressure."""
        plate = self.plates[side]
        force, point, moment = (np.stack([plate[f"{kind}{c}"] for c in "xyz"], axis=1) for kind in ("F", "cop", "T"))
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
            self.said.append(
                f"moments of the {SIDES[side]} plate, in {unit}, are about the point ({where}) m: moved to the centre "
                "of pressure"
            )
            return

    # motion -----------------------------------------------------------------------------------------------------------

    def units_of_motion(self, in_degrees: bool) -> None:
        """Angles in rad without jumps, translations in m."""
        high = float(np.abs(np.median(self.moves["q_pelvis_ty"])))
        unit = self.stated.get("translation_unit")
        if unit is None and high > HIGHEST_M:
            unit = "mm" if high * LENGTHS["cm"] > HIGHEST_M / 4.0 else "cm"
            self.said.append(f"translations of the pelvis are taken as {unit}: as m it is {high:.3g} m high")
        factor = LENGTHS[unit or "m"]
        self.moves = {n: v if is_angle(n) else factor * v for n, v in self.moves.items()}
        other = not in_degrees
        if "angle_unit" in self.stated:
            in_degrees = self.stated["angle_unit"] == "deg"
        elif self._is_other_unit(in_degrees):
            in_degrees, words = other, ("degrees", "rad") if other else ("rad", "degrees")
            self.said.append(f"angles are taken as {words[0]}: as {words[1]} its legs do not reach its feet")
        self.moves, jumped = coordinates_unwrapped(in_radians(self.moves, in_degrees))
        if jumped:
            names = ", ".join(n.removeprefix("q_") for n in jumped)
            self.said.append(f"{names} jumps by a turn of 360 degrees: it is unwrapped")

    def _is_other_unit(self, in_degrees: bool) -> bool:
        legs = [n for n in self.moves if n.startswith(("q_hip", "q_knee", "q_ankle"))]
        most = max(float(np.abs(self.moves[n]).max()) for n in legs)
        if not in_degrees and most > TURN:
            return True  # no joint turns so far
        if (in_degrees and most > TURN) or not self.long:
            return False
        now, then = (self._wandering(in_radians(self.moves, unit)) for unit in (in_degrees, not in_degrees))
        return now > WIDER * then > 0.0 and self._apart(1.0, in_radians(self.moves, not in_degrees)) < NEAR_M

    def _wandering(self, moves: Arrays) -> float:
        """How far centres of pressure wander from an ankle in a step, m, in the mean: the least of both feet's."""
        moves = coordinates_unwrapped(moves)[0]
        heading = _heading(pelvis_of(moves))
        legs = [leg_of(moves, self.time, side, knee) for side in SIDES for knee in (1.0, -1.0)]
        steps = [(self.plate(label, "cop"), on) for label in self.plates for on in self.steps(label)]
        return float(np.mean([min(_wandered(point, leg, heading, on) for leg in legs) for point, on in steps] or [0.0]))

    def unit_of_pressure(self) -> None:
        """Centres of pressure in m: under the feet."""
        unit = self.stated.get("pressure_unit")
        if unit:
            self.scale("cop", LENGTHS[unit])
        if unit or not self.long:
            return
        apart = {name: self._apart(factor, self.moves) for name, factor in LENGTHS.items()}
        best = min(apart, key=lambda name: apart[name])
        if apart["m"] > FAR_M and apart[best] < NEAR_M:
            self.scale("cop", LENGTHS[best])
            self.said.append(f"centres of pressure are taken as {best}: as m they lie {apart['m']:.3g} m from the feet")

    def _apart(self, factor: float, moves: Arrays) -> float:
        """Root mean square distance, level, of centres of pressure from the nearer foot, m."""
        legs = [leg_of(moves, self.time, side) for side in SIDES]
        found = []
        for label in self.plates:
            on = self.standing(label)
            point = factor * self.plate(label, "cop")[on]
            found.append(np.min([_level(point - leg.sole[on]) for leg in legs], axis=0))
        return float(np.sqrt(np.mean(np.concatenate(found) ** 2))) if any(map(len, found)) else 0.0

    def leg(self, side: str, knee: float) -> Leg:
        """One leg as the coordinates now are; `knee` is the sign of its knee's angle."""
        return leg_of(self.moves, self.time, side, knee)

    def signs_of_knees(self) -> None:
        """Flexion negative: with the other sign a foot that stands would move, and leave its centre of pressure."""
        signs = {
            s: {"negative": 1.0, "positive": -1.0}.get(self.stated.get(f"knee_flexion_{SIDES[s]}", "")) for s in SIDES
        }
        costs = {s: {k: self._unrest(s, k) if self.long else 0.0 for k in (1.0, -1.0)} for s in SIDES}
        both = knees_bend_positively(self.moves)

        def cost(pair: tuple[float, float]) -> float:
            mixed = UNUSUAL if pair[0] != pair[1] else 0.0
            usual = CLEAR if both != (pair == (-1.0, -1.0)) else 0.0
            return sum(costs[s][k] for s, k in zip(SIDES, pair, strict=True)) + mixed + usual

        right, left = ((1.0, -1.0) if sign is None else (sign,) for sign in signs.values())
        may = [(one, other) for one in right for other in left]
        best = min(may, key=cost)
        found = dict(zip(SIDES, best, strict=True))
        bent = [s for s, k in found.items() if k < 0.0]
        self.turned([f"knee_angle_{s}" for s in bent])
        if told := [SIDES[s] for s in bent if signs[s] is None]:
            knees = "both knees count" if len(told) == 2 else f"the {told[0]} knee counts"
            self.said.append(f"{knees} flexion positive: taken with the other sign")

    def _unrest(self, side: str, knee: float) -> float:
        """Minus the log-likelihood that a foot stands still under its centre of pressure, by what it scatters."""
        from fes_pin.data.smooth import CUTOFF_HZ  # noqa: PLC0415 - scipy

        on, leg = self.standing(side), self.leg(side, knee)
        if not on.any():
            return 0.0
        arm = self.plate(side, "cop") - leg.ankle
        still = (leg.velocity + np.cross(leg.spin, arm))[on][:, [0, 2]]
        scatter = np.log(np.sqrt(np.sum(np.var(still, axis=0))) + 1e-3)
        scatter += np.log(_wandered(self.plate(side, "cop"), leg, _heading(pelvis_of(self.moves)), on) + 1e-3)
        seconds = float(np.sum(on)) * float(self.time[-1] - self.time[0]) / (len(self.time) - 1)
        return 2.0 * CUTOFF_HZ * seconds * float(scatter)

    # plates -----------------------------------------------------------------------------------------------------------

    def whose_plates(self) -> None:
        """Which foot stands on which plate; a foot may stand on several, one after the other."""
        chosen = {label: side for key, side in zip(PLATES, SIDES, strict=True) for label in self.stated.get(key, ())}
        if odd := [label for label in chosen if label not in self.plates]:
            raise InputError(f"[conventions] states plate {odd[0]}; the file has {', '.join(self.plates)}")
        if chosen:
            self.plates = self._composed({label: [(0.0, s)] for label, s in chosen.items()})
        elif set(self.plates) == set(SIDES):
            self._exchanged()
        else:
            self._numbered()

    def _exchanged(self) -> None:
        """Feet that a file names stand on their own plates."""
        if not self.long:
            return
        apart = {(label, side): self._from_foot(label, side, self.standing(label)) for label in SIDES for side in SIDES}
        own, cross = (
            sum(apart[label, side] for label, side in apart if (label == side) is same) for same in (True, False)
        )
        if cross < NEARER * own:
            self.plates = {"r": self.plates["l"], "l": self.plates["r"]}
            self.said.append("columns of the right foot lie under the left one: the feet are exchanged on reading")

    def _numbered(self) -> None:
        """The foot that is nearer by far stands on a plate, step by step."""
        owners: dict[str, list[tuple[float, str]]] = {}
        words = []
        for label in self.plates:
            steps = []
            for here in self.steps(label):
                by = {side: self._from_foot(label, side, here) for side in SIDES}
                near, far = sorted(by, key=lambda side: by[side])
                times = self.time[here]
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
        self.said.append(", ".join(words))
        self.plates = self._composed(owners)

    def _from_foot(self, label: str, side: str, rows: np.ndarray) -> float:
        """Mean distance of a centre of pressure from a foot, level, m: the lesser of both signs of the knee."""
        if not rows.any():
            return 0.0
        legs = (self.leg(side, knee) for knee in (1.0, -1.0))
        return min(float(np.mean(_level(self.plate(label, "cop")[rows] - leg.sole[rows]))) for leg in legs)

    def _composed(self, owners: Mapping[str, Sequence[tuple[float, str]]]) -> dict[str, Arrays]:
        """Both feet's reactions: all that plates read while they are a foot's; `owners` by time, s."""
        n, out = len(self.push_time), {s: {kind.removeprefix("_"): np.zeros(0) for kind in PLATE} for s in SIDES}
        parts: dict[str, list[tuple[Arrays, np.ndarray]]] = {s: [] for s in SIDES}
        for label, steps in owners.items():
            at = np.array([at for at, _ in steps])
            nearest = np.abs(self.push_time[:, None] - at).argmin(axis=1)
            for side in SIDES:
                mine = np.isin(nearest, [k for k, (_, s) in enumerate(steps) if s == side])
                if mine.any():
                    parts[side].append((self.plates[label], mine))
        for side, each in parts.items():
            if len(each) == 1 and each[0][1].all():
                out[side] = each[0][0]
                continue
            force, moment, weigh, point = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n), np.zeros((n, 3))
            read = [
                tuple(np.stack([p[f"{k}{c}"] for c in "xyz"], axis=1) * on[:, None] for k in ("F", "cop", "T"))
                for p, on in each
            ]
            for f, c, _ in read:
                load = np.where(f[:, 1] > LOADED_N, f[:, 1], 0.0)
                force, weigh, point = force + f, weigh + load, point + load[:, None] * c
            point = point / np.maximum(weigh, 1e-9)[:, None]
            for f, c, t in read:
                moment += np.where((f[:, 1] > LOADED_N)[:, None], t + np.cross(c - point, f) * [0.0, 1.0, 0.0], 0.0)
            for kind, values in (("F", force), ("cop", point), ("T", moment)):
                out[side] |= {f"{kind}{c}": values[:, k] for k, c in enumerate("xyz")}
        return out


def level_in_the_air(up: np.ndarray, total: np.ndarray) -> float:
    """Return the vertical force that a plate reads while its foot is in the air, N; 0 of a foot that does not step.

    Parameters
    ----------
    up, total
        Vertical force of this plate and of both, (n,) N. A foot that steps carries half of the mean total at least.
    """
    least = up < np.quantile(up, LEAST) + LOADED_N
    level = float(np.median(up[least]))
    return level if np.mean(least) > SWINGS and 2.0 * (np.max(up) - level) > np.mean(total) else 0.0


def _is_person(weight_n: float, mass_kg: float | None) -> bool:
    """Whether a mean vertical force may be that of the body."""
    least, most = PERSON_KG if mass_kg is None else (share * mass_kg for share in CARRIED)
    return least < weight_n / 9.81 < most


def _heading(pelvis: np.ndarray) -> np.ndarray:
    """Level directions ahead and to the right of a pelvis: (n, 2, 2) in x and z."""
    ahead = pelvis[:, [0, 2], 0]
    ahead = ahead / np.maximum(np.linalg.norm(ahead, axis=1), 1e-9)[:, None]
    return np.stack([ahead, np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)], axis=1)


def _wandered(point: np.ndarray, leg: Leg, heading: np.ndarray, on: np.ndarray) -> float:
    """How far a centre of pressure wanders from an ankle, as the walker sees it, m."""
    seen = np.einsum("nij,nj->ni", heading[on], (point - leg.ankle)[on][:, [0, 2]])
    return float(np.sqrt(np.sum(np.var(seen, axis=0))))


def _level(vectors: np.ndarray) -> np.ndarray:
    return np.hypot(vectors[:, 0], vectors[:, 2])


def _correlation(one: np.ndarray, other: np.ndarray) -> float:
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return float(one @ other) / size if size else 0.0
