"""Writes fes_pin/body/gait_postures.csv: named postures of the measured walk (folder in FES_PIN_DATA or ../shared)."""

import os
from pathlib import Path

import numpy as np

from fes_pin.body.gait import TABLE, postures_of_walk
from fes_pin.body.joints import JOINT_NAMES

REPOSITORY = Path(__file__).parents[2]
LOADED_N = 20.0


def shared() -> Path:
    """The folder of measured data."""
    return Path(os.environ.get("FES_PIN_DATA", REPOSITORY.parent / "shared"))


def read(path: Path) -> np.ndarray:
    """A CSV file as a structured array."""
    return np.genfromtxt(path, delimiter=",", names=True)


def crossings(time: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Times at which a sampled value passes zero upwards."""
    up = np.flatnonzero((value[:-1] <= 0.0) & (value[1:] > 0.0))
    return time[up] - value[up] * (time[up + 1] - time[up]) / (value[up + 1] - value[up])


def smoothed(value: np.ndarray, width: int = 7) -> np.ndarray:
    """A running median: the force plates cross-talk by single samples."""
    padded = np.pad(value, width // 2, mode="edge")
    return np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1)


def body_track(walk: Path, body: str) -> tuple[np.ndarray, np.ndarray]:
    """Times and forward positions of a body's origin."""
    lines = [line.split(",") for line in (walk / "reference/bodies_mtpfree.csv").read_text().splitlines()[1:]]
    rows = np.array([[float(line[0]), float(line[2])] for line in lines if line[1] == body])
    return rows[:, 0], rows[:, 1]


def events(walk: Path) -> dict[str, float]:
    """Times (s) of the named postures of the right foot's first whole stance."""
    grf = read(walk / "grf_raw_600hz.csv")
    force = {side: smoothed(grf[f"{side}_Fy"]) - LOADED_N for side in "rl"}
    contact = crossings(grf["time"], force["r"])[0]
    other_off = next(t for t in crossings(grf["time"], -force["l"]) if t > contact)
    other_contact = next(t for t in crossings(grf["time"], force["l"]) if t > other_off)
    off = next(t for t in crossings(grf["time"], -force["r"]) if t > other_contact)
    t, right = body_track(walk, "talus_r")
    _, left = body_track(walk, "talus_l")
    passing = next(x for x in crossings(t, left - right) if other_off < x < other_contact)
    _, knee = body_track(walk, "tibia_l")
    upright = next(x for x in crossings(t, left - knee) if other_off < x < other_contact)
    return {
        "initial_contact": contact,
        "loading": 0.5 * (contact + other_off),
        "mid_stance": passing,
        "mid_swing": upright,
        "terminal_stance": 0.5 * (passing + other_contact),
        "pre_swing": 0.5 * (other_contact + off),
    }


def table(walk: Path) -> str:
    """The text of the table."""
    coordinates = read(walk / "coords_mtpfree.csv")
    postures = np.degrees(postures_of_walk({n: coordinates[n] for n in coordinates.dtype.names}, "right"))
    lines = [
        "# Named postures of a walk, on the right forefoot; degrees, rounded to 0.1; time_s in the recording.",
        "# Measured: treadmill walking of one adult, 72.6 kg, 1.135 m/s (opensim-org/opensim-models: Gait2354_Simbody;",
        "# CC BY 3.0: Delp, Loan, Hoy, Zajac, Topp, Rosen, Thelen, Anderson, Seth); inverse kinematics by OpenSim 4.6,",
        "# MTP joints free. Instants: the right foot's load passes 20 N; middle of first double support; left ankle",
        "# passes the right; left shank vertical; halfway from passing to left contact; middle of the second double",
        "# support. The stance ankle is set so that the forefoot lies flat, the rest stands in space as measured.",
        "# Made by scripts/generate/gait_postures.py.",
        ",".join(["posture", "time_s", *JOINT_NAMES]),
    ]
    for name, time in events(walk).items():
        angles = [np.interp(time, coordinates["time"], column) for column in postures.T]
        lines.append(",".join([name, f"{time:.3f}", *(f"{angle + 0.0:.1f}" for angle in angles)]))
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    TABLE.write_text(table(shared() / "data/walking_subject01"))
