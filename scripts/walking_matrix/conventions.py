"""Walks whose files follow other conventions on purpose, or other ways of the laboratory; how often each is said.

scripts/recorded walks --count 20
scripts/recorded walks --count 30 --ankles
"""

from __future__ import annotations

import argparse
import copy
import shutil
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from walks.synthetic import Gait, Wrong, gait_of, make, turn

import fes_pin as fp
from fes_pin.body.measured_walk import data_folder
from fes_pin.data.trial_files import walk_recordings
from fes_pin.data.walk_motion import FLATTER, flatter
from fes_pin.data.walk_recorded import RecordedWalk

Columns = dict[str, np.ndarray]
Y, Z, X = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
STORAGE = "walk\nnRows={}\ninDegrees={}\nendheader\n"


def limping(gait: Gait, seed: int) -> Gait:
    """Return a gait in which one knee or both hardly bend: stiff and hemiparetic gait, somewhat bent or straight."""
    random = np.random.default_rng([seed, 2])
    out = copy.deepcopy(gait)
    sides = str(random.choice(["r", "l", "rl"]))
    for side in sides:
        k = out.names.index(f"q_knee_angle_{side}")
        out.coefficients[1:, k] *= random.uniform(0.1, 0.4)
        out.coefficients[0, k] = -np.radians(random.uniform(4.0, 20.0))
    return out


def paced(gait: Gait, seed: int) -> Gait:
    """Return a gait of 0.7 to 1.45 of its period, and 0.65 to 1.15 of its excursions: slow to fast walking."""
    random, out = np.random.default_rng([seed, 7]), copy.deepcopy(gait)
    out.period *= random.uniform(0.7, 1.45)
    out.coefficients[1:] *= random.uniform(0.65, 1.15)
    return out


def with_ankles(least: float, most: float, drop_deg: float) -> Callable[[Gait, int], Gait]:
    """Return what scales the excursions of both ankles, and points the feet down by up to an angle."""

    def change(gait: Gait, seed: int) -> Gait:
        random, out = np.random.default_rng([seed, 8]), copy.deepcopy(gait)
        for side in "rl":
            k = out.names.index(f"q_ankle_angle_{side}")
            out.coefficients[1:, k] *= random.uniform(least, most)
            out.coefficients[0, k] -= np.radians(random.uniform(0.0, drop_deg))
        return out

    return change


GAITS: Mapping[str, Callable[[Gait, int], Gait]] = {
    "usual": lambda gait, _seed: gait,
    "limping": limping,
    "pointed feet": with_ankles(0.3, 0.7, 20.0),
    "stiff ankles": with_ankles(0.0, 0.3, 20.0),
}
"""Ways of walking in which the test of ankles is measured."""


def read(path: Path) -> Columns:
    """Columns of a CSV by name."""
    values = np.genfromtxt(path, delimiter=",", names=True)
    return {n: values[n] for n in values.dtype.names}


def put(path: Path, columns: Columns) -> None:
    """Write columns as CSV."""
    np.savetxt(
        path, np.stack(list(columns.values()), 1), delimiter=",", header=",".join(columns), comments="", fmt="%.9g"
    )


def put_storage(folder: Path, name: str, columns: Columns, header: str) -> None:
    """Write columns as .mot instead of the CSV of that name, in whose place the study then has it."""
    rows = "\n".join("\t".join(f"{v:.9g}" for v in row) for row in np.stack(list(columns.values()), 1))
    text = STORAGE.format(len(next(iter(columns.values()))), header) + "\t".join(columns) + f"\n{rows}\n"
    (folder / f"{name}.mot").write_text(text)
    study = folder / "study.toml"
    study.write_text(study.read_text().replace(f"{name}.csv", f"{name}.mot"))


def scaled(file: str, chosen: Callable[[str], bool], factor: float) -> Callable[[Path], None]:
    """Return what scales some columns of a file of a study."""

    def spoil(folder: Path) -> None:
        columns = read(folder / file)
        put(folder / file, {n: factor * v if chosen(n) else v for n, v in columns.items()})

    return spoil


def exchanged(folder: Path) -> None:
    """Name each foot as the other one."""
    columns = read(folder / "grf.csv")
    put(folder / "grf.csv", {{"r": "l", "l": "r"}.get(n[0], n[0]) + n[1:]: v for n, v in columns.items()})


def numbered(folder: Path, first: str = "l") -> None:
    """Number the plates, one foot's before the other's, as OpenSim names them."""
    columns = read(folder / "grf.csv")
    out = {"time": columns["time_s"]}
    for plate, side in enumerate((first, {"r": "l", "l": "r"}[first]), 1):
        for kind, what, letter in (("F", "force", "v"), ("cop", "force", "p"), ("T", "torque", "")):
            out |= {f"ground_{what}_{plate}_{letter}{c}": columns[f"{side}_{kind}{c}"] for c in "xyz"}
    put_storage(folder, "grf", out, "no")


def walkway(folder: Path) -> None:
    """Walk over ground, each step on the next of three plates in turn."""
    columns = read(folder / "grf.csv")
    time = columns["time_s"]
    out = {"time": time}
    plates = {k: {f"{kind}{c}": 0.0 * time for kind in ("F", "cop", "T") for c in "xyz"} for k in (1, 2, 3)}
    steps = []
    for side in "rl":
        on = columns[f"{side}_Fy"] > 10.0
        ends = np.flatnonzero(np.diff(np.r_[0, on.astype(int), 0]))
        steps += [(start, stop, side) for start, stop in zip(ends[::2], ends[1::2], strict=True)]
    for number, (start, stop, side) in enumerate(sorted(steps)):
        for name, values in plates[number % 3 + 1].items():
            values[start:stop] = columns[f"{side}_{name}"][start:stop]
    for k, plate in plates.items():
        for kind, what, letter in (("F", "force", "v"), ("cop", "force", "p"), ("T", "torque", "")):
            out |= {f"ground_{what}_{k}_{letter}{c}": plate[f"{kind}{c}"] for c in "xyz"}
    put_storage(folder, "grf", out, "no")


def degrees_said_to_be_rad(folder: Path, factor: float = 180.0 / np.pi, header: str = "no") -> None:
    """Write the coordinates in degrees under a header that says that they are not."""
    columns = read(folder / "coords.csv")
    angles = {n: factor * v if (n.startswith("q_") and not n.startswith("q_pelvis_t")) or n == "q_pelvis_tilt" else v
              for n, v in columns.items()}  # fmt: skip
    put_storage(
        folder, "coords", {n.removeprefix("q_").replace("time_s", "time"): v for n, v in angles.items()}, header
    )


def rad_said_to_be_degrees(folder: Path) -> None:
    """Write the coordinates in rad under a header that says degrees."""
    degrees_said_to_be_rad(folder, 1.0, "yes")


def about_origin(folder: Path) -> None:
    """Give moments about a corner of each plate."""
    columns = read(folder / "grf.csv")
    for side, corner in (("r", [0.3, -0.04, 0.5]), ("l", [-0.2, -0.04, -0.4])):
        force, point, free = (np.stack([columns[f"{side}_{k}{c}"] for c in "xyz"], 1) for k in ("F", "cop", "T"))
        columns |= dict(zip((f"{side}_T{c}" for c in "xyz"), (free + np.cross(point - corner, force)).T, strict=True))
    put(folder / "grf.csv", columns)


def turned(angle: float, wraps: bool = False, axis: np.ndarray = Y) -> Callable[[Path], None]:
    """Return what turns the laboratory by an angle, rad, about the vertical or another axis."""

    def spoil(folder: Path) -> None:
        moves, pushes = read(folder / "coords.csv"), read(folder / "grf.csv")
        tilt, lean, rotation = (moves[f"q_pelvis_{n}"] for n in ("tilt", "list", "rotation"))
        about = turn(axis, np.array([angle]))[0]
        pelvis = about @ turn(Z, tilt) @ turn(X, lean) @ turn(Y, rotation)
        _put_pelvis(moves, pelvis, wraps)
        place = np.stack([moves[f"q_pelvis_t{c}"] for c in "xyz"], 1) @ about.T
        moves |= {f"q_pelvis_t{c}": place[:, k] for k, c in enumerate("xyz")}
        for side in "rl":
            for kind in ("F", "cop", "T"):
                values = np.stack([pushes[f"{side}_{kind}{c}"] for c in "xyz"], 1) @ about.T
                pushes |= {f"{side}_{kind}{c}": values[:, k] for k, c in enumerate("xyz")}
        put(folder / "coords.csv", moves)
        put(folder / "grf.csv", pushes)

    return spoil


def over_ground(by: float, speed: float = 1.1) -> Callable[[Path], None]:
    """Return what has the walker go over ground, m/s, and turn to the left by an angle, rad, midway.

    Forces turn with the walker: what this costs of inertia is left out, so that the motion does not require them.
    """

    def spoil(folder: Path) -> None:
        moves, pushes = read(folder / "coords.csv"), read(folder / "grf.csv")
        fine = np.linspace(-1.0, moves["time_s"][-1] + 1.0, 4000)
        angle = by * np.clip((fine / moves["time_s"][-1] - 0.3) / 0.4, 0.0, 1.0)
        way = np.cumsum(np.stack([np.cos(angle), 0.0 * fine, -np.sin(angle)], 1), axis=0) * speed * (fine[1] - fine[0])
        centre = np.array([moves["q_pelvis_tx"].mean(), 0.0, moves["q_pelvis_tz"].mean()])

        def moved(values: np.ndarray, time: np.ndarray, place: bool) -> np.ndarray:
            about = turn(Y, np.interp(time, fine, angle))
            on = np.stack([np.interp(time, fine, column) for column in way.T], 1) if place else 0.0
            return np.einsum("nij,nj->ni", about, values - (centre if place else 0.0)) + on

        time = moves["time_s"]
        tilt, lean, rotation = (moves[f"q_pelvis_{n}"] for n in ("tilt", "list", "rotation"))
        pelvis = turn(Y, np.interp(time, fine, angle)) @ turn(Z, tilt) @ turn(X, lean) @ turn(Y, rotation)
        _put_pelvis(moves, pelvis, True)
        place = moved(np.stack([moves[f"q_pelvis_t{c}"] for c in "xyz"], 1), time, True)
        moves |= {f"q_pelvis_t{c}": place[:, k] for k, c in enumerate("xyz")}
        for side in "rl":
            loaded = pushes[f"{side}_Fy"] != 0.0
            for kind in ("F", "cop", "T"):
                values = np.stack([pushes[f"{side}_{kind}{c}"] for c in "xyz"], 1)
                values = moved(values, pushes["time_s"], kind == "cop") * loaded[:, None]
                pushes |= {f"{side}_{kind}{c}": values[:, k] for k, c in enumerate("xyz")}
        put(folder / "coords.csv", moves)
        put(folder / "grf.csv", pushes)

    return spoil


def _put_pelvis(moves: Columns, pelvis: np.ndarray, wraps: bool) -> None:
    """Give the pelvis an orientation: R = Rz(tilt) Rx(list) Ry(rotation)."""
    moves["q_pelvis_list"] = np.arcsin(np.clip(pelvis[:, 2, 1], -1.0, 1.0))
    moves["q_pelvis_tilt"] = np.arctan2(-pelvis[:, 0, 1], pelvis[:, 1, 1])
    rotation = np.arctan2(-pelvis[:, 2, 0], pelvis[:, 2, 2])
    moves["q_pelvis_rotation"] = rotation if wraps else np.unwrap(rotation)


def later(seconds: float) -> Callable[[Path], None]:
    """Return what has both clocks begin at another time."""

    def spoil(folder: Path) -> None:
        for file in ("coords.csv", "grf.csv"):
            columns = read(folder / file)
            columns["time_s"] = columns["time_s"] + seconds
            put(folder / file, columns)

    return spoil


def reordered(folder: Path) -> None:
    """Write all columns but the time in the opposite order."""
    for file in ("coords.csv", "grf.csv"):
        (time, values), *rest = read(folder / file).items()
        put(folder / file, {time: values, **dict(reversed(rest))})


def _joint(joint: str, sides: str) -> Callable[[Path], None]:
    return scaled("coords.csv", lambda n: n in [f"q_{joint}_angle_{s}" for s in sides], -1.0)


WRONG: Mapping[str, tuple[Callable[[Path], None], str]] = {
    "right knee": (_joint("knee", "r"), "the right knee counts flexion positive"),
    "left knee": (_joint("knee", "l"), "the left knee counts flexion positive"),
    "both knees": (_joint("knee", "rl"), "both knees count flexion positive"),
    "left ankle": (_joint("ankle", "l"), "the left ankle counts dorsiflexion negative"),
    "both ankles": (_joint("ankle", "rl"), "both ankles count dorsiflexion negative"),
    "exchanged feet": (exchanged, "the feet are exchanged"),
    "numbered plates": (numbered, "plate 1 is the left foot's, plate 2 is the right foot's"),
    "three plates": (walkway, "plate 3 is "),
    "action": (scaled("grf.csv", lambda n: n[2] in "FT", -1.0), "as those on the ground"),
    "shear sign": (scaled("grf.csv", lambda n: n[2:] in ("Fx", "Fz"), -1.0), "forces along x are taken with the other"),
    "lateral sign": (scaled("grf.csv", lambda n: n[2:] == "Fz", -1.0), "forces along z are taken with the other sign"),
    "moments in N mm": (scaled("grf.csv", lambda n: n[2] == "T", 1000.0), "moments are taken as N mm"),
    "moments about a corner": (about_origin, "are about the point"),
    "moment sign": (scaled("grf.csv", lambda n: n[2] == "T", -1.0), "are taken with the other sign: its motion"),
    "forces in kN": (scaled("grf.csv", lambda n: n[2:3] == "F", 0.001), "forces are taken as kN"),
    "degrees under no": (degrees_said_to_be_rad, "angles are taken as degrees"),
    "rad under yes": (rad_said_to_be_degrees, "angles are taken as rad"),
    "wraps": (turned(np.pi, wraps=True), "pelvis_rotation jumps by a turn"),
    "pressure in mm": (scaled("grf.csv", lambda n: "cop" in n, 1000.0), "centres of pressure are taken as mm"),
    "translations in mm": (scaled("coords.csv", lambda n: n in ("q_pelvis_tx", "q_pelvis_ty", "q_pelvis_tz"), 1000.0),
                           "translations of the pelvis are taken as mm"),
    "inclined axes": (turned(np.radians(-15.0), axis=Z), "the axes are taken as inclined by 1"),
}  # fmt: skip
"""What is done to a study on purpose, and what a remark must then say."""
TWICE = ("shear sign", "moments about a corner")
"""Of these two things are said: of each axis, of each plate."""
RIGHT: Mapping[str, Callable[[Path], None]] = {
    "as it is": lambda _folder: None,
    "laboratory turned by 90 degrees": turned(np.pi / 2.0),
    "laboratory turned by -40 degrees": turned(np.radians(-40.0)),
    "laboratory turned by 180 degrees": turned(np.pi),
    "clock that began 1000 s before": later(1000.0),
    "columns reordered": reordered,
}
"""What changes nothing that is to be said."""


def walk(gait: Gait, folder: Path, seed: int, limps: bool) -> None:
    """Make a walk without a hidden cause, of a person and 2 to 5 strides of that seed."""
    strides = int(np.random.default_rng([seed, 3]).integers(2, 6))
    make(limping(gait, seed) if limps else gait, folder, Wrong(strides=strides, tissue=0.5), seed)


def said_of(folder: Path, motion: bool = True) -> tuple[str, ...]:
    """What `check` says of a study, or its reader alone, without the whole body's motion; the refusal, if refused."""
    try:
        study = fp.read_study(folder)
        return fp.check(study).odd if motion else study.trials[0].remarks
    except fp.InputError as error:
        return (f"refused: {error}",)


def named(name: str, said: tuple[str, ...]) -> bool:
    """Whether a wrong convention is named, and nothing else is said."""
    return len(said) == 1 + (name in TWICE) and WRONG[name][1] in " ".join(said)


def ankles(gait: Gait, seeds: range) -> None:
    """Print by what factor flat feet turn faster with the wrong sign of their ankle, and with the right one."""
    for name, change in GAITS.items():
        wrong = []
        for seed in seeds:
            with tempfile.TemporaryDirectory() as place:
                make(change(paced(gait, seed), seed), Path(place), Wrong(strides=2, tissue=0.5), seed)
                (time, moves), (push_time, pushes) = walk_recordings(fp.read_study(place).trials[0])
            plates = {side: {n[2:]: v for n, v in pushes.items() if n.startswith(f"{side}_")} for side in "rl"}
            walk = RecordedWalk(time, dict(moves), push_time, plates, {})
            wrong += [float(np.exp(-flatter(walk, side))) for side in "rl"]
        told = np.mean(np.array(wrong) > FLATTER)
        print(f"{name}: wrong {min(wrong):.2f} to {max(wrong):.2f}, {told:.1%} above {FLATTER}; "
              f"right {1.0 / max(wrong):.2f} to {1.0 / min(wrong):.2f}")  # fmt: skip


def main() -> None:
    """Print how often each wrong convention is named, and what is said of right ones."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--ankles", action="store_true", help="measure the test of their sign instead")
    asked = parser.parse_args()
    gait = gait_of(data_folder())
    if asked.ankles:
        ankles(gait, range(asked.seed, asked.seed + asked.count))
        return
    good = dict.fromkeys((*WRONG, *RIGHT), 0)
    for seed in range(asked.seed, asked.seed + asked.count):
        with tempfile.TemporaryDirectory() as place:
            whole = Path(place) / "walk"
            walk(gait, whole, seed, seed % 2 == 1)
            for name in good:
                folder = Path(place) / name.replace(" ", "_")
                shutil.copytree(whole, folder)
                spoil = WRONG[name][0] if name in WRONG else RIGHT[name]
                spoil(folder)
                said = said_of(folder, motion=name in ("moment sign", "as it is"))
                if named(name, said) if name in WRONG else not said:
                    good[name] += 1
                else:
                    print(f"  seed {seed}, {name}: {said}", flush=True)
        print(f"seed {seed} done", flush=True)
    for name, count in good.items():
        what = "named and nothing else said" if name in WRONG else "nothing said, as is right"
        print(f"{name}: {what} in {count} of {asked.count}")


if __name__ == "__main__":
    main()
