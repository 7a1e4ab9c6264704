"""Measured walking as wanted torque: angles and joint torques of a stride, in this project's joints and signs."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fes_pin.body.gait import ankle_torques, postures_of_walk
from fes_pin.body.joints import JOINT_NAMES, SIDES
from fes_pin.body.passive import Passive
from fes_pin.data.datasets import VARIABLE, WALKING
from fes_pin.data.errors import InputError
from fes_pin.data.named import NamedArray
from fes_pin.data.recorded.text import read_csv
from fes_pin.data.table import check_times

ANGLES, TORQUES = "coords_mtpfree.csv", "reference/grf_id_mtpfree.csv"
"""The two files of the walk that are read."""
SAME_TIME = 1e-6
"""Times that differ by no more are the same, s."""

REFERENCE = {
    "knee_flexion": ("knee_angle", -1.0),
    "ankle_dorsiflexion": ("ankle_angle", 1.0),
    "ankle_inversion": ("subtalar_angle", 1.0),
    "mtp_extension": ("mtp_angle", 1.0),
}
"""This project's leg joints and the reference's coordinates where these have other names. They extend the knee
positively; the ankle's are about other axes and are converted."""


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredWalk:
    """Angles and inverse-dynamics torques of a walk.

    Attributes
    ----------
    time, q, torque
        (samples,) s, (samples, 19) rad and N m by joint name; what the reference does not know is 0. The ankle's are
        about the body's own axes (`fes_pin.body.gait.ankle_torques`), not the reference's oblique ones.
    known
        (19,) bool, joints whose torque the reference knows: not `ankle_rotation` (it has no such joint), nor
        `mtp_extension` (it puts the whole ground reaction on the hindfoot).
    """

    time: np.ndarray
    q: NamedArray
    torque: NamedArray
    known: np.ndarray

    def __post_init__(self) -> None:
        for name in ("q", "torque"):
            object.__setattr__(self, name, NamedArray(getattr(self, name), JOINT_NAMES))

    @property
    def rates(self) -> NamedArray:
        """Joint rates, (samples, 19) rad/s by joint name."""
        return NamedArray(np.gradient(np.asarray(self.q), self.time, axis=0), JOINT_NAMES)

    def active(self, passive: Passive) -> "MeasuredWalk":
        """The same walk with the torque that muscles must make: what inverse dynamics gives less the passive torque.

        Parameters
        ----------
        passive
            `PassiveLegs` or `ElasticJoints` of `fes_pin.body.passive`, damping included; joints whose torque is not
            known stay at 0.
        """
        order = list(JOINT_NAMES)
        given = np.array([passive.torque(q, order) for q in np.asarray(self.q)]) - self.rates @ passive.damping(order)
        active = np.where(self.known, self.torque - given, 0.0)
        return replace(self, torque=NamedArray(active, JOINT_NAMES))


def data_folder() -> Path:
    """Return the folder `walking_subject01`, in FES_PIN_DATA or in `shared` next to the repository.

    Raises
    ------
    InputError
        It is in neither; the message says where the data come from.
    """
    root = Path(os.environ.get(VARIABLE, Path(__file__).parents[2].parent / "shared"))
    for folder in (root / WALKING.name, root / "data" / WALKING.name, root):
        if (folder / ANGLES).is_file():
            return folder
    missing = f"no {WALKING.name}/{ANGLES} there; set {VARIABLE} to the folder that holds it"
    what = f"joint angles and inverse dynamics by OpenSim of {WALKING.origin} ({WALKING.licence})"
    raise InputError(f"{missing}: {what}", file=root)


def columns_of_numbers(path: Path, wanted: Sequence[str]) -> dict[str, np.ndarray]:
    """Columns of a table of numbers by name, `time` first; columns that are not wanted may hold anything.

    Raises
    ------
    InputError
        The file cannot be read, a column is missing, a row is ragged, a number is none, time does not rise evenly:
        with row and column.
    """
    table = read_csv(path, wanted)
    for name in wanted:
        if name not in table.names:
            raise table.error("missing", name)
    check_times(table.columns["time"], table.error, "time")
    return dict(table.columns)


def read_walk(folder: str | Path | None = None) -> MeasuredWalk:
    """Read angles and reference torques of the measured walk.

    Raises
    ------
    InputError
        A file or a column is missing or cannot be read (`numbers`), or the two files are of other times.
    """
    folder = Path(folder) if folder is not None else data_folder()
    sources: dict[int, tuple[str, float]] = {}
    for i, joint in enumerate(JOINT_NAMES):
        side, _, name = joint.partition("_")
        if side == "lumbar":
            sources[i] = joint, 1.0
        elif name != "ankle_rotation":  # of which the reference has none
            coordinate, sign = REFERENCE.get(name, (name, 1.0))
            sources[i] = f"{coordinate}_{side[0]}", sign
    angles = columns_of_numbers(folder / ANGLES, ["time", *(f"q_{name}" for name, _ in sources.values())])
    torques = columns_of_numbers(folder / TORQUES, ["time", *(f"ID_{name}_moment" for name, _ in sources.values())])
    time = angles["time"]
    if len(time) != len(torques["time"]) or np.abs(time - torques["time"]).max() > SAME_TIME:
        raise InputError(f"expected the times of {ANGLES}", file=folder / TORQUES, column="time")
    q = postures_of_walk(angles, "right", flat_foot=False)
    torque = NamedArray(np.zeros(q.shape), JOINT_NAMES)
    for i, (coordinate, sign) in sources.items():
        torque[:, i] = sign * torques[f"ID_{coordinate}_moment"]
    for side in SIDES:
        ankle = [f"{side}_ankle_{name}" for name in ("dorsiflexion", "inversion", "rotation")]
        theirs = np.stack([angles[f"q_{name}_{side[0]}"] for name in ("ankle_angle", "subtalar_angle")], axis=1)
        torque[ankle] = ankle_torques(side, theirs, torque[ankle[:2]], q[ankle[0]], q[ankle[1]])
    known = np.array([i in sources and not name.endswith("mtp_extension") for i, name in enumerate(JOINT_NAMES)])
    return MeasuredWalk(time, q, torque * known, known)
