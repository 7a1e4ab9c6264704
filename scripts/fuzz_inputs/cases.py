"""Cases by number: what is made, how it is made odd or spoilt, and the call that reads it."""

from __future__ import annotations

import functools
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fes_pin.data.study import write_study
from fuzz_inputs.check import Answer, call
from fuzz_inputs.oddities import odd_study
from fuzz_inputs.spoil import spoilt
from fuzz_inputs.studies import RIGS, small_study

KINDS = ("study", "study", "csv", "toml", "urdf", "model", "trial")
"""Odd studies are the slowest and find most: two of seven. The others are spoilt files: of a study to diagnose, or of a
model and a trial to predict."""


@dataclass(frozen=True)
class Result:
    """How one case ended."""

    name: str
    answer: Answer
    faults: list[str]

    def __str__(self) -> str:
        return f"{self.name}: {'; '.join(self.faults)}"


def run_case(number: int, seed: int, work: Path, cache: Path) -> Result:
    """Make one case in an empty folder, call the command line, and check its answer.

    Parameters
    ----------
    cache
        Where compiled models are kept; the only other place that may be written.
    """
    rng = np.random.default_rng([seed, number])
    kind, rig = KINDS[number % len(KINDS)], str(rng.choice(RIGS))
    shutil.rmtree(work, ignore_errors=True)
    study, out, scratch = work / "study", work / "out", work / "scratch"
    scratch.mkdir(parents=True)
    made, told = small_study(rng, rig), ""
    if kind == "study":
        told, made = odd_study(made, rng)
    write_study(made, study)
    if kind in ("model", "trial"):
        (study / "model.toml").write_text(_model(rig), encoding="utf-8")
        target = study / "model.toml" if kind == "model" else study / f"trials/{made.trials[0].name}.csv"
        settings = [f"--set={n}={v:g}" for n, v in made.trials[0].conditions.items()]
        out = work / "predicted.csv"
        given = ["predict", str(study / "model.toml"), str(study / f"trials/{made.trials[0].name}.csv"), *settings]
    else:
        names = {"csv": f"trials/{made.trials[-1].name}.csv", "toml": "study.toml", "urdf": "rig.urdf"}
        target = study / names.get(kind, "study.toml")
        if kind == "urdf" and (found := sorted(study.glob("*.urdf"))):
            target = found[0]
        elif kind == "urdf":
            target = study / "study.toml"
        given = ["diagnose", str(study)]
    if kind != "study":
        target.write_bytes(spoilt(target.read_bytes(), rng))
    answer = call([*given, "--out", str(out)], [out, cache], scratch)
    return Result(f"{number} {kind} {rig} {told}".strip(), answer, answer.faults(out.exists()))


@functools.cache
def _model(rig: str) -> str:
    from fes_pin.models.nominal import nominal_model  # noqa: PLC0415
    from fes_pin.models.store import model_toml  # noqa: PLC0415

    return model_toml(nominal_model(small_study(np.random.default_rng(0), rig)))
