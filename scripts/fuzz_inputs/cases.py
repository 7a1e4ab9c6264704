"""Cases by number: what is made, how it is made odd or spoilt, and the call that reads it."""

from __future__ import annotations

import functools
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fes_pin.data.study import Study, write_study
from fuzz_inputs.check import READING_SECONDS, SECONDS, Answer, call
from fuzz_inputs.oddities import odd_study
from fuzz_inputs.recordings import coordinates, ground_reaction, instrument
from fuzz_inputs.spoil import spoilt
from fuzz_inputs.studies import RIGS, small_study
from fuzz_inputs.views import with_views

KINDS = ("study", "study", "csv", "toml", "urdf", "model", "trial")
"""Odd studies are the slowest and find most: two of seven. The others are spoilt files: of a study to diagnose, or of a
model and a trial to predict."""
READING_KINDS = (*KINDS[2:], "recording", "walk", "view", "files")
"""Spoilt files alone, and views of recordings; of what `fes-pin new-study` reads as well: an instrument's recording, a
walk in two `.mot`, two files of one trial."""
SAID = (
    *(("--column", f"position=Angle{more}") for more in ("", ":deg", ",scale=-1", ":nobody", "s")),
    *(("--column", what) for what in ("effort=Torque", "effort=", "time_s=t:ms", "time_s=rate=50", "velocity=Angle")),
    *(("--split", at) for at in ("restarts", "holes", "rests", "Angle", "none")),
    *(("--set", what) for what in ("kind=imposed", "from=0.1", "to=0.3", "a.csv:from=9", "damping=x")),
    *(("--header-row", "1"), ("--header-row", "0"), ("--first-row", "9"), ("--names", "t,q,u"), ("--transposed",)),
    *(("--resample", "50"), ("--resample", "1e6"), ("--fill",), ("--role", "a.csv=held_out")),
)
"""What a person may say of a recording, right and wrong."""


@dataclass(frozen=True)
class Result:
    """How one case ended."""

    name: str
    answer: Answer
    faults: list[str]

    def __str__(self) -> str:
        return f"{self.name}: {'; '.join(self.faults)}"


@dataclass(frozen=True)
class Call:
    """What is asked of `fes-pin`, the file that is spoilt before (None: none), and where it may write."""

    given: list[str]
    target: Path | None
    out: Path


def run_case(number: int, seed: int, work: Path, cache: Path, reading: bool = False) -> Result:
    """Make one case in an empty folder, call the command line, and check its answer.

    Parameters
    ----------
    cache
        Where compiled models are kept; the only other place that may be written.
    reading
        Ask only what reads and fits nothing: `fes-pin check` instead of `diagnose`, and `READING_KINDS`.
    """
    rng = np.random.default_rng([seed, number])
    kinds = READING_KINDS if reading else KINDS
    kind, rig = kinds[number % len(kinds)], str(rng.choice(RIGS))
    shutil.rmtree(work, ignore_errors=True)
    scratch = work / "scratch"
    scratch.mkdir(parents=True)
    told = ""
    if kind in ("recording", "walk", "files"):
        asked = _new_study(kind, work, rng)
    else:
        made = small_study(rng, rig)
        if kind == "study":
            told, made = odd_study(made, rng)
        write_study(made, work / "study")
        if kind == "view":
            with_views(work / "study", rng)
        predicts = kind in ("model", "trial")
        asked = _predict(kind, rig, made, work) if predicts else _diagnose(kind, made, work, reading)
    if asked.target is not None:
        asked.target.write_bytes(spoilt(asked.target.read_bytes(), rng))
    answer = call(asked.given, [asked.out, cache], scratch, READING_SECONDS if reading else SECONDS)
    return Result(f"{number} {kind} {rig} {told}".strip(), answer, answer.faults(asked.out.exists()))


def _diagnose(kind: str, made: Study, work: Path, reading: bool) -> Call:
    study, out = work / "study", work / "out"
    urdf = next(iter(sorted(study.glob("*.urdf"))), study / "study.toml")
    targets = {"study": None, "view": None, "csv": study / f"trials/{made.trials[-1].name}.csv", "urdf": urdf}
    given = ["check", str(study)] if reading else ["diagnose", str(study), "--out", str(out)]
    return Call(given, targets.get(kind, study / "study.toml"), out)


def _predict(kind: str, rig: str, made: Study, work: Path) -> Call:
    model, trial = work / "study/model.toml", made.trials[0]
    model.write_text(_model(rig), encoding="utf-8")
    recorded, out = work / f"study/trials/{trial.name}.csv", work / "predicted.csv"
    settings = [f"--set={n}={v:g}" for n, v in trial.conditions.items()]
    given = ["predict", str(model), str(recorded), *settings, "--out", str(out)]
    return Call(given, model if kind == "model" else recorded, out)


def _new_study(kind: str, work: Path, rng: np.random.Generator) -> Call:
    if kind == "recording":
        recording, out = work / "a.csv", work / "made"
        recording.write_text(instrument(rng), encoding="utf-8")
        said = [word for option in rng.permutation(len(SAID))[: int(rng.integers(4))] for word in SAID[option]]
        return Call(["new-study", str(recording), "--pendulum", "0.3", "1", *said, "--out", str(out)], recording, out)
    if kind == "files":
        files, out = (work / "a_pos.csv", work / "a_tau.csv"), work / "made"
        for path in files:
            path.write_text(instrument(rng), encoding="utf-8")
        given = ["new-study", *map(str, files), "--rod", "0.3", "1", "--source", "pos=*pos", "--source", "tau=*tau"]
        named = ["--column", "position=pos.Angle", "--column", "effort=tau.Torque", "--offset", "tau=fit"]
        return Call([*given, *named, "--out", str(out)], files[int(rng.integers(2))], out)
    files, out = (work / "coordinates.mot", work / "forces.mot"), work / "made"
    for path, text in zip(files, (coordinates(rng), ground_reaction(rng)), strict=True):
        path.write_text(text, encoding="utf-8")
    given = ["new-study", *map(str, files), "--rig", "body", "--set", "mass_kg=70", "--set", "height_m=1.8"]
    return Call([*given, "--out", str(out)], files[int(rng.integers(2))], out)


@functools.cache
def _model(rig: str) -> str:
    from fes_pin.models.nominal import nominal_model  # noqa: PLC0415
    from fes_pin.models.store import model_toml  # noqa: PLC0415

    return model_toml(nominal_model(small_study(np.random.default_rng(0), rig)))
