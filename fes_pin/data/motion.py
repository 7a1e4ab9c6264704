"""Walking data: joint coordinates and ground reactions from CSV and from OpenSim's .mot and .sto files."""

import re
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.files import read_text
from fes_pin.data.recorded.form import TextForm
from fes_pin.data.recorded.text import names_of, read_csv, table_of_lines
from fes_pin.data.schema import is_like, unknown
from fes_pin.data.table import Table, check_time

TRANSLATIONS = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
LEG = ("hip_flexion", "hip_adduction", "hip_rotation", "knee_angle", "ankle_angle")
REQUIRED = (
    *("pelvis_tilt", "pelvis_list", "pelvis_rotation"),
    *TRANSLATIONS,
    *(f"{joint}_{side}" for side in "rl" for joint in LEG),
)
OPTIONAL = (
    *(f"{joint}_{side}" for side in "rl" for joint in ("subtalar_angle", "mtp_angle")),
    *("lumbar_extension", "lumbar_bending", "lumbar_rotation"),
)
PLATE = tuple(f"_{kind}{axis}" for kind in ("F", "cop", "T") for axis in "xyz")
GROUND_REACTION = tuple(f"{side}{kind}" for side in "rl" for kind in PLATE)
"""Columns of one plate after its label, and of both feet."""

_OPENSIM_GROUND = re.compile(
    r"^(?P<before>(?:\d|[rl]|right|left)_|)ground_(?P<what>force|torque|moment)"
    r"_?(?:(?P<foot>\d|[rl]|right|left|calcn_[rl])_)?(?P<kind>[vpm]?)(?P<axis>[xyz])$",
    re.IGNORECASE,
)
STORAGE = (".mot", ".sto")
"""Suffixes of OpenSim's files, whose columns have its own names."""
MARKERS = (".c3d", ".trc")
"""Suffixes of files of markers."""
NO_ANGLES = "holds markers: OpenSim's inverse kinematics makes joint coordinates of them, and its .mot is read here"
APART_M = 0.02
"""Least sideways distance of two plates' centres of pressure that identifies the right foot's."""
ONE_TURN = 2.0 * np.pi * (1.0 + 1e-3)
"""rad; an angle that wraps varies by no more, but for rounding."""
SPELT = {
    **{"flex": "flexion", "add": "adduction", "rot": "rotation", "ext": "extension", "bend": "bending"},
    **{"knee_flexion": "knee_angle", "ankle_dorsiflexion": "ankle_angle", "ankle_flexion": "ankle_angle"},
}
"""Other names of coordinates, as in the knee model of Lenhart et al. (Ann. Biomed. Eng. 43:2675): words, and joints
with their motion. Words that may mean either sign, as abduction, are none of them; that of an ankle a walk shows."""
BENT_RAD, BACK_RAD = 0.7, -0.26
"""Knees that both pass the first and never the second count flexion positive: none extends 0.7 rad beyond straight."""


def read_motion(path: str | Path) -> tuple[Table, bool | None]:
    """Read a CSV, .mot or .sto file whose first column is the time.

    Returns
    -------
    table : Table
        The numbers as they stand in the file.
    in_degrees : bool or None
        What the header of a .mot or .sto file says of its angles; None where it says nothing. CSV is in rad: False.

    Raises
    ------
    InputError
        As `read_csv` and `check_time`; a header without `endheader`, or that states another number of rows.
    """
    path = Path(path)
    if path.suffix.lower() in MARKERS:
        raise InputError(f"{path.suffix} {NO_ANGLES}", file=path)
    table, in_degrees = _read_storage(path) if is_storage(path) else (read_csv(path), False)
    if table.names[0] not in ("time", "time_s"):
        raise table.error(f"expected time_s or time as the first column, found {table.names[0][:40]}", "time_s")
    check_time(table)
    return table, in_degrees


def is_storage(path: Path) -> bool:
    """True of a file as OpenSim writes it."""
    return path.suffix.lower() in STORAGE


def is_rotation(label: str) -> bool:
    """True of a column of OpenSim's files whose unit `inDegrees` states: no translation, force or moment."""
    return not re.search(
        r"(^time$|_t[xyz]$|_t[xyz]/|force|torque|moment|activation|excitation|_[vp][xyz]$)", label.lower()
    )


def _read_storage(path: Path) -> tuple[Table, bool | None]:
    """A file as OpenSim writes it, or a spreadsheet that has saved it: with commas or semicolons, some at line ends."""
    lines = [line.replace('"', "").rstrip(" ,;\r") for line in read_text(path).split("\n")]
    end = next((i for i, line in enumerate(lines) if line.strip().lower() == "endheader"), None)
    if end is None:
        raise InputError("expected a line endheader, as OpenSim writes it", file=path, row=len(lines))
    header = next((i for i in range(end + 1, len(lines)) if lines[i].strip()), None)
    if header is None:
        raise InputError("expected column labels after endheader", file=path, row=len(lines))
    delimiter = next((sign for sign in ";," if sign in lines[header]), " ")
    decimal = "," if delimiter == ";" and any("," in line for line in lines[header + 1 :]) else "."
    form = TextForm(delimiter, decimal, header_row=header + 1, first_row=header + 2, strict=True)
    table = table_of_lines(path, lines, names_of(path, lines, form), form)
    keys = {}
    for line in lines[:end]:
        key, _, value = line.partition("=") if "=" in line else line.strip().partition(" ")
        keys[key.strip().lower()] = value.strip()
    rows = keys.get("nrows", keys.get("datarows"))
    if rows is not None and rows != str(len(table)):
        table = replace(table, said=(f"the header of {path.name} says {rows[:20]} rows, and there are {len(table)}",))
    return table, {"yes": True, "no": False}.get(keys.get("indegrees", "").lower())


def read_coordinates(path: str | Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Joint coordinates by OpenSim's names, in rad and m.

    Returns
    -------
    time : ndarray, shape (n,)
        s.
    columns : dict of ndarray, shape (n,)
        `q_<coordinate>`, and `qd_`, `qdd_` (rad/s, rad/s2, m/s, m/s2) if the file has them.

    Raises
    ------
    InputError
        As `read_motion`; a required coordinate is missing or in another unit; a .mot or .sto file that does not say
        whether its angles are in degrees.
    """
    table, in_degrees = read_motion(path)
    return table.time, coordinates_of(table, in_degrees)


def coordinates_of(table: Table, in_degrees: bool | None) -> dict[str, np.ndarray]:
    """The coordinates that a table holds, in rad and m, by themselves; see `read_coordinates`.

    Flexion of a knee is negative, as gait2354 has it; Rajagopal's model counts it positive (IEEE Trans. Biomed. Eng.
    63:2068).
    """
    columns = in_radians(named_coordinates(table), stated_degrees(table, in_degrees))
    columns, _ = coordinates_unwrapped(columns)
    return joints_turned(columns, "knee", "rl") if knees_bend_positively(columns) else columns


def stated_degrees(table: Table, in_degrees: bool | None) -> bool:
    """Whether the header says degrees; InputError where it says nothing."""
    if in_degrees is None:
        raise InputError("expected inDegrees=yes or inDegrees=no in the header", file=table.path, row=1)
    return in_degrees


def named_coordinates(table: Table) -> dict[str, np.ndarray]:
    """The coordinates that a table holds as `q_<coordinate>`, with their rates, in the units of the file.

    Raises
    ------
    InputError
        A required coordinate is missing, or in another unit, or one is misspelt.
    """
    storage = is_storage(table.path)
    names = {(_coordinate(name) if storage else name): name for name in table.names[1:]}
    names = {respelt(name, names): of for name, of in names.items()}
    known = [f"q_{name}" for name in (*REQUIRED, *OPTIONAL)]
    for name in known[: len(REQUIRED)]:
        if name not in names:
            raise _missing(table, name.removeprefix("q_") if storage else name, table.names)
    for name, original in names.items():
        if name.startswith("q_") and name not in known and is_like(name, known, cutoff=0.92):
            raise table.error(unknown(name, known), original)
    return {name: table.columns[of] for name, of in names.items() if name.startswith(("q_", "qd_", "qdd_"))}


def respelt(name: str, names: Collection[str]) -> str:
    """A column `q_<coordinate>`, or of its rates, by the name that is used here; as it is where names hold that."""
    kind, apart, rest = name.partition("_")
    words = "_".join(SPELT.get(word, word) for word in rest.split("_"))
    for other, usual in SPELT.items():
        words = words.replace(f"{other}_", f"{usual}_") if words.startswith(f"{other}_") else words
    usual = f"{kind}{apart}{words}"
    is_known = kind in ("q", "qd", "qdd") and words in (*REQUIRED, *OPTIONAL)
    return usual if is_known and usual not in names else name


def renamed_coordinates(table: Table) -> tuple[str, ...]:
    """What is said of coordinates whose names in the file are other ones than are used here; () of none."""
    names = [_coordinate(name) if is_storage(table.path) else name for name in table.names[1:]]
    pairs = [(name, usual) for name in names if (usual := respelt(name, names)) != name and name.startswith("q_")]
    words = [f"{name.removeprefix('q_')} as {usual.removeprefix('q_')}" for name, usual in pairs]
    return (f"{', '.join(words)}: coordinates are taken by these names",) if words else ()


def is_angle(name: str) -> bool:
    """Whether a column `q_<coordinate>`, or of its rates, is of an angle."""
    return name.split("_", 1)[1] not in TRANSLATIONS


def in_radians(columns: Mapping[str, np.ndarray], in_degrees: bool) -> dict[str, np.ndarray]:
    """Coordinates with their angles in rad."""
    return {n: v * (np.pi / 180.0 if in_degrees and is_angle(n) else 1.0) for n, v in columns.items()}


def coordinates_unwrapped(columns: Mapping[str, np.ndarray]) -> tuple[dict[str, np.ndarray], list[str]]:
    """Coordinates whose angles, rad, do not jump by a turn, and the names of those that did.

    What wraps stays within one turn.
    """
    within = {n: v for n, v in columns.items() if n.startswith("q_") and is_angle(n) and np.ptp(v) < ONE_TURN}
    angles = {n: np.unwrap(v) for n, v in within.items()}
    jumped = [n for n, v in angles.items() if np.ptp(v - columns[n]) > np.pi]
    turns = {n: angles[n] - 2.0 * np.pi * np.round(np.mean(angles[n]) / (2.0 * np.pi)) for n in jumped}
    return {**columns, **turns}, jumped


def knees_bend_positively(columns: Mapping[str, np.ndarray]) -> bool:
    """True of coordinates that count the flexion of knees positive: none extends so far beyond straight."""
    knees = [columns[f"q_knee_angle_{side}"] for side in "rl"]
    return all(bool(knee.max() > BENT_RAD and knee.min() > BACK_RAD) for knee in knees)


def joints_turned(columns: Mapping[str, np.ndarray], joint: str, sides: Collection[str]) -> dict[str, np.ndarray]:
    """Coordinates with a knee or ankle of these sides, `r` and `l`, and its rates counted with the other sign."""
    turned = {f"{kind}_{joint}_angle_{side}" for kind in ("q", "qd", "qdd") for side in sides}
    return {name: -values if name in turned else values for name, values in columns.items()}


def _coordinate(name: str) -> str:
    """A label as a column: `knee_angle_r` and `/jointset/knee_r/knee_angle_r/value` -> `q_knee_angle_r`."""
    parts = name.strip("/").split("/")
    if len(parts) > 1:
        prefix = {"value": "q_", "speed": "qd_"}.get(parts[-1])
        return f"{prefix}{parts[-2]}" if prefix else name
    return name if name.startswith(("q_", "qd_", "qdd_")) else f"q_{name}"


def read_ground_reaction(path: str | Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Ground reaction of both feet at its own sample rate.

    A .mot or .sto file may name its columns as OpenSim does. Where it names no foot, `ground_force_...` is the right
    one and `1_ground_force_...` the left one, as in OpenSim's gait examples; of plates 1 and 2 the right foot's is that
    whose centre of pressure lies further to the right, z in OpenSim's axes.

    Returns
    -------
    time : ndarray, shape (n,)
        s.
    columns : dict of ndarray, shape (n,)
        `r_` and `l_`: `F[xyz]` N, `cop[xyz]` m, `T[xyz]` N m about the centre of pressure.

    Raises
    ------
    InputError
        As `read_motion`; a column is missing.
    """
    table, _ = read_motion(path)
    return table.time, ground_reaction_of(table)


def ground_reaction_of(table: Table) -> dict[str, np.ndarray]:
    """The ground reaction that a table holds; see `read_ground_reaction`."""
    plates = plates_in(table)
    if not set(plates) & set("rl"):
        right = _right_plate(table, plates)
        plates = {("r" if label == right else "l"): values for label, values in plates.items()}
    for name in GROUND_REACTION:
        if name[0] not in plates:
            raise _missing(table, name, table.names)
    return {name: plates[name[0]][name[2:]] for name in GROUND_REACTION}


def plates_in(table: Table) -> dict[str, dict[str, np.ndarray]]:
    """Columns `Fx` ... `Tz` of every plate, (n,), by the foot that the file names, `r` or `l`, or the plate's number.

    Raises
    ------
    InputError
        A column of a plate is missing, or there is no plate.
    """
    names = _plate_columns(table)
    labels = list(dict.fromkeys(n[0] for n in names if n[1:] in PLATE)) or ["r"]
    for name in (f"{label}{kind}" for label in labels for kind in PLATE):
        if name not in names:
            raise _missing(table, name, table.names)
    return {label: {kind[1:]: table.columns[names[f"{label}{kind}"]] for kind in PLATE} for label in labels}


def _plate_columns(table: Table) -> dict[str, str]:
    """The names of a table's columns by what they are of a plate, `r_Fx` or `1_Fx`; others by themselves."""
    names = {(_ground(name) if is_storage(table.path) else name): name for name in table.names[1:]}
    labels = {n[0] for n in names if n[1:] in PLATE}
    numbered = {n for n in labels if n.isdigit()}
    if not numbered or "r" not in labels:
        return names
    # as in OpenSim's gait examples, where a column without a foot or number is of `r`
    called = {"1": "l"} if numbered == {"1"} else {"r": "0"}
    return {called.get(n[0], n[0]) + n[1:]: of for n, of in names.items()}


def _ground(name: str) -> str:
    """`ground_force_r_vx` as `r_Fx`, and so without a foot; of a numbered plate `1_Fx`."""
    found = _OPENSIM_GROUND.match(name)
    if not found:
        return name
    foot = (found["foot"] or found["before"]).lower().strip("_").removeprefix("calcn_")[:1] or "r"
    kind = found["kind"].lower()
    kind = "T" if found["what"].lower() != "force" or kind == "m" else {"p": "cop"}.get(kind, "F")
    return f"{foot}_{kind}{found['axis'].lower()}"


def _right_plate(table: Table, plates: Mapping[str, Mapping[str, np.ndarray]]) -> str:
    """Which of two plates is under the right foot of one who walks along x, where nothing is known of the feet."""
    across = {}
    for label, plate in plates.items():
        load = np.clip(plate["Fy"], 0.0, None)
        across[label] = float(load @ plate["copz"] / max(load.sum(), 1e-9))
    if len(across) != 2 or np.ptp(list(across.values())) < APART_M:
        message = "expected columns that name the foot, r_ and l_: the plates' order does not show it"
        raise InputError(message, file=table.path, row=table.header_row or None)
    return max(across, key=lambda plate: across[plate])


def _missing(table: Table, name: str, names: tuple[str, ...]) -> InputError:
    known = {*REQUIRED, *OPTIONAL, *(f"q_{each}" for each in (*REQUIRED, *OPTIONAL)), *GROUND_REACTION}
    joint, side = name.removeprefix("q_").partition("_")[0], name[-2:]
    near = [each for each in names if each not in known and is_like(each, [name], cutoff=0.85)]
    near += [n for n in names if n not in known and joint in n.split("_") and n.endswith(side)]
    return table.error("missing" + (f"; found {near[0][:40]}, which is another name or unit" if near else ""), name)


def on_common_time(
    time: np.ndarray, columns: Mapping[str, np.ndarray], other_time: np.ndarray, other: Mapping[str, np.ndarray]
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Two recordings on the first one's times, where both were recorded.

    The second is interpolated linearly and not filtered: what it holds above half the first one's sample rate folds
    back. Where that matters, read the file by itself (`read_ground_reaction`) and filter both.

    Returns
    -------
    time : ndarray, shape (n,)
    columns : dict of ndarray, shape (n,)
    """
    both = (time >= other_time[0]) & (time <= other_time[-1])
    shared = time[both]
    joined = {name: values[both] for name, values in columns.items()}
    same = len(shared) == len(other_time) and np.array_equal(shared, other_time)
    for name, values in other.items():
        joined[name] = values if same else np.interp(shared, other_time, values)
    return shared, joined
