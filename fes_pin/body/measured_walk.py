"""Measured walking as wanted torque: angles and joint torques of a stride, in this project's joints and signs."""

from __future__ import annotations

import csv
import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fes_pin.body.joints import JOINT_NAMES
from fes_pin.body.passive import Passive
from fes_pin.data.errors import InputError

REFERENCE = {
    "hip_flexion": ("hip_flexion", 1.0),
    "hip_adduction": ("hip_adduction", 1.0),
    "hip_rotation": ("hip_rotation", 1.0),
    "knee_flexion": ("knee_angle", -1.0),
    "ankle_dorsiflexion": ("ankle_angle", 1.0),
    "ankle_inversion": ("subtalar_angle", 1.0),
    "mtp_extension": ("mtp_angle", 1.0),
}
"""This project's leg joints and the reference's coordinates, which extend the knee positively."""


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredWalk:
    """Angles and inverse-dynamics torques of a walk.

    Attributes
    ----------
    time, q, torque
        (samples,) s, (samples, 19) rad and N m in the order of `JOINT_NAMES`; what the reference does not know is 0.
    known
        (19,) bool, joints whose torque the reference knows: not `ankle_rotation` (it has no such joint), nor
        `mtp_extension` (it puts the whole ground reaction on the hindfoot).
    """

    time: np.ndarray
    q: np.ndarray
    torque: np.ndarray
    known: np.ndarray

    @property
    def known_joints(self) -> tuple[str, ...]:
        """Names of the joints whose torque is known."""
        return tuple(name for name, known in zip(JOINT_NAMES, self.known, strict=True) if known)

    def active(self, passive: Passive) -> MeasuredWalk:
        """The same walk with the torque that muscles must make: what inverse dynamics gives less the passive torque.

        Parameters
        ----------
        passive
            `PassiveLegs` or `ElasticJoints` of `fes_pin.body.passive`, damping included; joints whose torque is not
            known stay at 0.
        """
        order = list(JOINT_NAMES)
        rates = np.gradient(self.q, self.time, axis=0)
        given = np.array([passive.torque(q, order) for q in self.q]) - rates @ passive.damping(order)
        return replace(self, torque=np.where(self.known, self.torque - given, 0.0))


def data_folder() -> Path:
    """The folder `walking_subject01`, in FES_PIN_DATA or in `shared` beside the repository.

    Raises
    ------
    InputError
        It is in neither.
    """
    root = Path(os.environ.get("FES_PIN_DATA", Path(__file__).parents[2].parent / "shared"))
    for folder in (root / "walking_subject01", root / "data" / "walking_subject01", root):
        if (folder / "coords_mtpfree.csv").is_file():
            return folder
    raise InputError("no walking_subject01 there; set FES_PIN_DATA to the folder that holds it", file=root)


def columns(path: Path) -> dict[str, np.ndarray]:
    """Columns of a table of numbers by name; words become NaN."""
    with path.open(newline="") as file:
        rows = list(csv.reader(file))

    def number(text: str) -> float:
        try:
            return float(text)
        except ValueError:
            return np.nan

    values = np.array([[number(cell) for cell in row] for row in rows[1:]])
    return dict(zip(rows[0], values.T, strict=True))


def read_walk(folder: str | Path | None = None) -> MeasuredWalk:
    """Read angles and reference torques of the measured walk.

    Raises
    ------
    InputError
        The folder or a column is missing.
    """
    folder = Path(folder) if folder is not None else data_folder()
    paths = folder / "coords_mtpfree.csv", folder / "reference" / "grf_id_mtpfree.csv"
    for path in paths:
        if not path.is_file():
            raise InputError("no such file", file=path)
    angles, torques = (columns(path) for path in paths)
    count = len(angles["time"])
    q, torque, known = (
        np.zeros((count, len(JOINT_NAMES))),
        np.zeros((count, len(JOINT_NAMES))),
        np.zeros(len(JOINT_NAMES), dtype=bool),
    )
    for i, joint in enumerate(JOINT_NAMES):
        side, _, name = joint.partition("_")
        if side == "lumbar":
            coordinate, sign = joint, 1.0
        elif name in REFERENCE:
            coordinate, sign = f"{REFERENCE[name][0]}_{side[0]}", REFERENCE[name][1]
        else:
            continue
        if f"q_{coordinate}" not in angles or f"ID_{coordinate}_moment" not in torques:
            raise InputError(f"no column for {coordinate}", file=folder)
        q[:, i], torque[:, i] = sign * angles[f"q_{coordinate}"], sign * torques[f"ID_{coordinate}_moment"]
        known[i] = name != "mtp_extension"
    return MeasuredWalk(angles["time"], q, np.where(known, torque, 0.0), known)
