"""What `fes-pin new-study` is asked of a recording, right and wrong, and the files that it is asked of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fuzz_inputs.bodies import walking
from fuzz_inputs.others import nested, serial, side_by_side
from fuzz_inputs.recordings import coordinates, ground_reaction, instrument
from fuzz_inputs.stated import UNITS
from fuzz_inputs.texts import one_of, recording

Rng = np.random.Generator
INSTRUMENT = ["t", "Angle", "Torque"]
RIGS = (
    *(["--pendulum", "0.3", "1"], ["--rod", "0.3", "1"], ["--slide", "2"], ["--wheel", "0.01"]),
    *(["--pendulum", "0.3", "1", "--upright"], ["--rig", "muscle"], ["--rig", "ankle", "--set", "foot_mass_kg=0.1"]),
    *(["--rig", "muscle", "--set", "threshold_us=100", "--set", "saturation_us=400"], []),
)
SAID = (
    *(("--split", at) for at in ("restarts", "holes", "rests", "columns", "none", "Angle")),
    *(
        ("--set", what)
        for what in ("kind=imposed", "from=0.1", "to=0.3", "a.csv:from=9", "damping=x", "rig.damping=0.1")
    ),
    *(("--header-row", "1"), ("--header-row", "0"), ("--first-row", "9"), ("--names", "t,q,u"), ("--transposed",)),
    *(("--resample", "50"), ("--resample", "1e6"), ("--fill",), ("--role", "a.csv=held_out"), ("--sheet", "data")),
    *(("--group", "a*=x"), ("--name", "my study"), ("--offset", "a=fit"), ("--source", "a=*a")),
    *(("--set", "to=nan"), ("--set", "load_kg=1"), ("--set", "position0=0.1"), ("--resample", "0"), ("--split", "x")),
)
"""What a person may say of a recording, right and wrong; `--column` is said of its names."""
TAKEN = (
    "position",
    "velocity",
    "effort",
    "force_n",
    "stim",
    "pulse_width_us",
    "emg",
    "angle_rad",
    "torque_nm",
    "nobody",
)
MORE = ("", "", ",scale=-1", ",scale=0.01", ",zero=90", ",edge=0.5", ",scale=x", ",zero=1e308", ":x,", ",edge=")

OFFSETS = ("tau=fit", "tau=0.01", "tau=fit", "tau=0.01", "tau=-0.1", "tau=-9", "pos=0.1", "tau=nan", "x=fit", "tau=")


@dataclass(frozen=True)
class Call:
    """What is asked of `fes-pin`, the file that is spoilt before (None: none), and where it may write."""

    given: list[str]
    target: Path | None
    out: Path


def said(rng: Rng, names: list[str], most: int = 4) -> list[str]:
    """Options, of which some are right, for columns of these names: a rig, which column is which, and others."""
    if len(names) < 2 or rng.uniform() < 0.1:
        return [*RIGS[int(rng.integers(len(RIGS)))], *_others(rng, most)]
    taken = ("position", "effort")[: int(rng.integers(1, 3))]
    if is_odd := rng.uniform() < 0.2:
        taken = tuple(str(one) for one in rng.permutation(TAKEN)[:2])
    words = list(RIGS[int(rng.integers(len(RIGS))) if is_odd else int(rng.integers(3))])
    if rng.uniform() < 0.2:
        words += ["--column", f"time_s={_said_of_time(rng, names[0])}"]
    for own, name in zip(taken, names[1:], strict=False):
        unit = f":{one_of(rng, UNITS)}" if rng.uniform() < 0.1 else ""
        words += ["--column", f"{own}={name}{unit}{one_of(rng, MORE) if is_odd else ''}"]
    return words + (_others(rng, most) if is_odd or rng.uniform() < 0.3 else [])


def _others(rng: Rng, most: int) -> list[str]:
    return [word for k in rng.permutation(len(SAID))[: int(rng.integers(most))] for word in SAID[k]]


def _said_of_time(rng: Rng, name: str) -> str:
    return one_of(rng, (name, name, f"{name}:ms", f"{name}:s", "rate=50", "rate=0", "", f"{name}:h"))


def of_recording(work: Path, rng: Rng, content: bytes, names: list[str], suffix: str = ".csv") -> Call:
    """One recording, that is spoilt where `target` says so, and a study of it elsewhere."""
    path = work / f"a{suffix}"
    path.write_bytes(content)
    is_spoilt = rng.uniform() < 0.3
    words = ["new-study", str(path), *said(rng, names)]
    return Call([*words, "--out", str(work / "made")], path if is_spoilt else None, work / "made")


def of_files(work: Path, rng: Rng) -> Call:
    """Two files of one trial, or two trials."""
    files, out = (work / "a_pos.csv", work / "a_tau.csv"), work / "made"
    one = instrument(rng).encode()
    for path in files:
        path.write_bytes(recording(rng)[0] if rng.uniform() < 0.1 else one)
        one = instrument(rng).encode() if rng.uniform() < 0.1 else one
    given = ["new-study", *map(str, files)]
    if rng.uniform() < 0.8:
        given += [
            "--rod",
            "0.3",
            "1",
            "--source",
            "pos=*pos",
            "--source",
            one_of(rng, (*("tau=*tau",) * 6, "tau=*", "tau=")),
        ]
        more = one_of(rng, MORE) if rng.uniform() < 0.3 else ""
        given += ["--column", f"position=pos.Angle{more}", "--column", "effort=tau.Torque"]
        given += ["--offset", one_of(rng, OFFSETS)] if rng.uniform() < 0.7 else []
        given += _others(rng, 2)
    else:
        given += said(rng, INSTRUMENT)
    return Call([*given, "--out", str(out)], files[int(rng.integers(2))] if rng.uniform() < 0.6 else None, out)


def of_walk(work: Path, rng: Rng) -> Call:
    """Coordinates and ground reaction of noise, or of what is nearly a walk."""
    files, out = [work / "coordinates.mot", work / "forces.mot"], work / "made"
    texts = (coordinates(rng), ground_reaction(rng)) if rng.uniform() < 0.3 else walking(rng)
    for k, text in enumerate(texts):
        files[k] = files[k] if "endheader" in text else files[k].with_suffix(".csv")
        files[k].write_text(text, encoding="utf-8")
    given = ["new-study", *map(str, files), "--rig", "body", "--set", "mass_kg=70", "--set", "height_m=1.8"]
    given += ["--set", one_of(rng, ("knee_flexion_left=positive", "force_unit=kN", "belt_speed_mps=1.2", "axes=x"))]
    return Call([*given, "--out", str(out)], files[int(rng.integers(2))] if rng.uniform() < 0.7 else None, out)


def _of_suffix(work: Path, rng: Rng) -> Call:
    suffix = one_of(rng, (".json", ".json", ".mat"))
    return of_recording(work, rng, *nested(rng, suffix), suffix)


RECORDED: dict[str, Callable[[Path, Rng], Call]] = {
    "recording": lambda work, rng: of_recording(work, rng, instrument(rng).encode(), INSTRUMENT),
    "text": lambda work, rng: of_recording(work, rng, *recording(rng)),
    "columns": lambda work, rng: of_recording(work, rng, *side_by_side(rng)),
    "serial": lambda work, rng: of_recording(work, rng, *serial(rng), ".log"),
    "nested": _of_suffix,
    "files": of_files,
    "walk": of_walk,
}
"""By kind of case, what is recorded and asked."""
