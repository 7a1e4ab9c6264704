"""Public recordings as they are published, made studies: what `fes-pin datasets` does with what it fetches.

Each function takes the folder that holds the upstream files and their paths in the repository, as `datasets.json` lists
them, and gives the files of a study. The steps are those that the data set's description names; nothing is filtered.
Recordings that a study reads as they are have no function: `as_published` takes their study from `datasets.json`.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from fes_pin.data.errors import InputError
from fes_pin.data.files import read_json
from fes_pin.data.recorded.nested import matlab_vectors
from fes_pin.data.table import format_csv
from fes_pin.data.templates import arm_urdf, slide_urdf
from fes_pin.data.units import INCH, POUND

SHORT = "{:.6g}".format
Files = dict[str, str]

SERVO_PULSES, SERVO_TORQUE, SERVO_RESISTANCE = 885.0, 0.3232, 4.7637
"""Full pulse width of the servo's PWM; torque constant in N m/A and resistance in Ohm as the data's authors identified
them (Rhoban/bam, params/xl330/m1.json)."""
SERVO_COLUMNS = ("timestamp", "position", "speed", "load", "input_volts", "torque_enable")
SERVO_RATE_HZ, DAMPER_RATE_HZ = 200.0, 500.0


def servo_pendulum(folder: Path, places: Iterable[str]) -> Files:
    """A servo that carries a known mass: logs of 3.4 to 7 ms a row, interpolated to 200 Hz, the effort held.

    effort = kt/R (PWM / 885 x supply - kt w), 0 while the motor is off.

    Raises
    ------
    InputError
        A log that is not as they were when this was written.
    """
    files, trials = {}, []
    for place in places:
        log = read_json(folder / place)
        try:
            rows = [[float(row[key]) for key in SERVO_COLUMNS] for row in log["entries"]]
        except (KeyError, TypeError, ValueError) as problem:
            raise InputError(f"not a log as it was when this was written: {problem}", file=folder / place) from None
        t, q, w, pwm, volts, on = np.array(rows).T
        current = (pwm / SERVO_PULSES * volts - SERVO_TORQUE * w) / SERVO_RESISTANCE
        effort = np.where(on > 0.5, SERVO_TORQUE * current, 0.0)
        time = np.arange(int((t[-1] - t[0]) * SERVO_RATE_HZ) + 1) / SERVO_RATE_HZ
        row = np.searchsorted(t - t[0], time + 1e-12, side="right") - 1
        name = f"{log['trajectory']}_kp{log['kp']}"
        columns = {"time_s": time, "effort": effort[row], "position": np.interp(time, t - t[0], q)}
        files[f"trials/{name}.csv"] = format_csv(columns, SHORT)
        role = "fit" if log["trajectory"] in ("lift_and_drop", "sin_sin") else "held_out"
        trials.append({"file": f"trials/{name}.csv", "role": role})
    what = "0.49 kg at 0.1 m on the horn of the servo; the arm and the servo's reflected inertia are not in here."
    files["pendulum.urdf"] = arm_urdf("servo_pendulum", what, 0.49, -0.1, 1e-6, 1e-6)
    rig, start = {"urdf": "pendulum.urdf", "gravity_scale": 1.0}, {"inertia_scale": 1.2, "damping": 0.01}
    return {**files, "study.toml": _study("servo-pendulum", rig, start, sorted(trials, key=lambda t: t["file"]))}


_DAMPER_FILE = re.compile(r".*-(\d)/.*/([\d.]+Hz)(\d+lb)tension(?:([\d.]+)amplitude)?\.json")
"""Which data set, rate, tension that the experimenter set, and in the later one the amplitude in inches."""


def friction_damper(folder: Path, places: Iterable[str]) -> Files:
    """A banded friction damper: inch to m, kip to N, 1024 Hz interpolated to 500 Hz; actuators' forces left out.

    Raises
    ------
    InputError
        A file that is not as they were when this was written.
    """
    files, trials = {}, []
    for place in places:
        number, rate_hz, tension, wide = _DAMPER_FILE.findall(place)[0]
        name = f"d{number}_{tension}_{rate_hz.lower()}" + (f"_{wide}in" if wide else "")
        group = tension.replace("lb", " lb, 2023" if wide else " lb")
        try:
            table = np.array(read_json(folder / place)["data"], dtype=float)
            t, inches, kips, rate = table[:, 0], table[:, 1], table[:, 2], table[:, 3]
        except (KeyError, IndexError, TypeError, ValueError) as problem:
            raise InputError(f"not a test as it was when this was written: {problem}", file=folder / place) from None
        time = np.arange(int((t[-1] - t[0]) * DAMPER_RATE_HZ + 1e-9) + 1) / DAMPER_RATE_HZ
        columns = {"position": INCH * inches, "velocity": INCH * rate, "effort": 1e3 * POUND * kips}
        at = {n: np.interp(time, t - t[0], v) for n, v in columns.items()}
        files[f"trials/{name}.csv"] = format_csv({"time_s": time, **at}, SHORT)
        role = "fit" if "_0.5hz" in name else "held_out"
        trials.append({"file": f"trials/{name}.csv", "kind": "imposed", "group": group, "role": role})
    what = "The damper's rod, driven horizontally. The moving mass is not published: 20 kg is a guess."
    files["damper.urdf"] = slide_urdf("friction_damper", what, 20.0, 0.1, 0.05)
    rig, start = {"urdf": "damper.urdf", "gravity_scale": 0.0}, {"inertia_scale": 1.0, "damping": 1e5}
    return {**files, "study.toml": _study("friction-damper", rig, start, trials)}


def free_pendulum(folder: Path, places: Iterable[str]) -> Files:
    """Free swings in MATLAB cells: `Y_id`, `Y_vad` with angle and rate, `Time_id`, `Time_vad` with their times.

    Raises
    ------
    InputError
        A file that does not hold them, or pymatreader is not installed.
    """
    path = folder / next(iter(places))
    found = matlab_vectors(path)
    files, trials = {}, []
    for ours, theirs, role in (("fit", "id", "fit"), ("held", "vad", "held_out")):
        for number in range(1, 100):
            names = (f"Time_{theirs}.{number}", f"Y_{theirs}.{number}.1", f"Y_{theirs}.{number}.2")
            time, angle, rate = map(found.get, names)
            if time is None or angle is None or rate is None:
                break
            rows = zip((time - time[0]).tolist(), angle.tolist(), rate.tolist(), strict=True)
            lines = [f"{t:.3f},{q:.6f},{v:.6f}" for t, q, v in rows]
            place = f"trials/{ours}_{number - 1}.csv"
            files[place] = "\n".join(["time_s,position,velocity", *lines]) + "\n"
            trials.append({"file": place, "role": role})
    if len({t["role"] for t in trials}) < 2:
        raise InputError("expected cells Y_id, Time_id, Y_vad and Time_vad", file=path)
    what = "A rigid pendulum on a fixed pivot; position 0 is upright. As its authors identified it (arXiv:2205.06231)."
    files["pendulum.urdf"] = arm_urdf("free_pendulum", what, 0.14758, 0.14775, 1.0912e-4, 1e-6)
    start = {"inertia_scale": 1.0, "gravity_scale": 1.0, "damping": 2.2394e-4}
    return {**files, "study.toml": _study("free-pendulum", {"urdf": "pendulum.urdf"}, start, trials)}


def as_published(folder: Path, published: Mapping[str, Any]) -> Files:
    """Text recordings as they are, and the study of them that `datasets.json` states.

    Parameters
    ----------
    published
        "tables" of study.toml, "files" by path in the study their path in the repository, and "arm", what `arm_urdf`
        takes.
    """
    files = {ours: (folder / theirs).read_bytes().decode() for ours, theirs in published["files"].items()}
    urdf = arm_urdf(**published["arm"])
    return {**files, published["tables"]["rig"]["urdf"]: urdf, "study.toml": tomli_w.dumps(published["tables"])}


CONVERTERS: Mapping[str, Callable[[Path, Iterable[str]], Files]] = {
    one.__name__: one for one in (free_pendulum, friction_damper, servo_pendulum)
}
"""By data set what makes a study of it."""


def _study(name: str, rig: Mapping[str, Any], start: Mapping[str, float], trials: list[dict[str, str]]) -> str:
    return tomli_w.dumps({"study": {"name": name, "rig": "joint"}, "rig": rig, "start": start, "trial": trials})
