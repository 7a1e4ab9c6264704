"""Cases by number: what is made, how it is made odd or spoilt, and the call that reads it."""

from __future__ import annotations

import contextlib
import functools
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fes_pin.data.study import Study, write_study
from fuzz_inputs.asked import RECORDED, Call
from fuzz_inputs.bodies import study_text, walking
from fuzz_inputs.check import READING_SECONDS, SECONDS, Answer, Ask, call
from fuzz_inputs.oddities import odd_study
from fuzz_inputs.recordings import instrument
from fuzz_inputs.spoil import spoilt
from fuzz_inputs.stated import columns, mistyped
from fuzz_inputs.studies import RIGS, URDF_OF, kept_study, small_study
from fuzz_inputs.views import views, with_views

KINDS = ("study", "study", "csv", "toml", "urdf", "model", "trial")
"""Odd studies are the slowest and find most: two of seven. The others are spoilt files: of a study to diagnose, or of a
model and a trial to predict."""
READING_KINDS = (*KINDS[2:], "view", "stated", "types", "body", "text", *RECORDED)
"""Spoilt files alone; views of recordings, conventions that are stated, values of other types, walks; and what
`fes-pin new-study` reads. Text is the form of most recordings: two of seventeen."""
FITTED = 8
"""One in so many cases that only read has `check` fit the nominal model as well."""
SCRATCH, OUT = "scratch", "out"


@dataclass(frozen=True)
class Result:
    """How one case ended."""

    name: str
    answer: Answer
    faults: list[str]

    def __str__(self) -> str:
        return f"{self.name}: {'; '.join(self.faults)}"


def run_case(number: int, seed: int, work: Path, cache: Path, reading: bool = False, ask: Ask = call) -> Result:
    """Make one case in an empty folder, call the command line, and check its answer.

    A study that `new-study` wrote is read again by `check`. That of a rig is read; a walk is judged only then.

    Parameters
    ----------
    cache
        Where compiled models are kept; the only other place that may be written.
    reading
        Ask only what reads: `fes-pin check` instead of `diagnose`, and `READING_KINDS`.
    ask
        Calls the command line.
    """
    rng = np.random.default_rng([seed, number])
    kinds = READING_KINDS if reading else KINDS
    kind, rig = kinds[number % len(kinds)], str(rng.choice(RIGS))
    shutil.rmtree(work, ignore_errors=True)
    scratch = work / SCRATCH
    scratch.mkdir(parents=True)
    told = ""
    if kind in RECORDED:
        asked = RECORDED[kind](work, rng)
    elif kind in ("stated", "body"):
        asked = _stated(kind, work, rng)
    else:
        made = kept_study(rng, rig) if reading else small_study(rng, rig)
        if kind == "study":
            told, made = odd_study(made, rng)
        write_study(made, work / "study")
        if kind == "view":
            with_views(work / "study", rng)
        predicts = kind in ("model", "trial")
        asked = _predict(kind, rig, made, work) if predicts else _diagnose(kind, made, work, reading)
    if kind == "types" or (kind in ("stated", "body") and rng.uniform() < 0.2):
        toml = work / "study/study.toml"
        toml.write_text(mistyped(toml.read_text(encoding="utf-8"), rng), encoding="utf-8")
    elif asked.target is not None:
        asked.target.write_bytes(spoilt(asked.target.read_bytes(), rng))
    name = f"{number} {kind} {rig} {told}".strip()
    limit = READING_SECONDS if reading else SECONDS
    before = _contents(work, asked.out)
    with reads_only(reading and (number // len(kinds)) % FITTED > 0):
        answer = ask(asked.given, [asked.out, cache], scratch, limit)
        faults = answer.faults(asked.out.exists(), asked.given)
        if not faults and answer.code == 0 and kind in RECORDED:
            again = ask(["check", str(asked.out)], [cache], scratch, limit)
            read = [f"check of what was written: {f}" for f in again.faults(False, ["check", str(asked.out)])]
            faults += read or [f"check of what was written: {again.err.strip()}"] * (again.code != 0 and kind != "walk")
    faults += [f"changed {path.relative_to(work)}" for path, held in before.items() if _content(path) != held]
    return Result(name, answer, faults)


def _contents(work: Path, out: Path) -> dict[Path, bytes | None]:
    """What stands in each file of a case, but for where a call may write."""
    files = (path for path in work.rglob("*") if path.is_file() and not {out, work / SCRATCH} & {path, *path.parents})
    return {path: _content(path) for path in files}


def _content(path: Path) -> bytes | None:
    return path.read_bytes() if path.exists() else None


def _diagnose(kind: str, made: Study, work: Path, reading: bool) -> Call:
    study, out = work / "study", work / OUT
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


def _stated(kind: str, work: Path, rng: np.random.Generator) -> Call:
    """A study of recordings as instruments write them, or of a walk, with conventions that it states."""
    study = work / "study"
    study.mkdir()
    if kind == "body":
        texts = walking(rng)
        names = [f"{n}.{'mot' if 'endheader' in t else 'csv'}" for n, t in zip(("coords", "grf"), texts, strict=True)]
        text = study_text(rng, (names[0], names[1]))
    else:
        texts, names = (instrument(rng, bare=True), instrument(rng, bare=True)), ["a.csv", "b.csv"]
        (study / "rig.urdf").write_text(URDF_OF["joint"], encoding="utf-8")
        tables = [f'[[trial]]\nfile = "{name}"\n' for name in names]
        text = STATED_STUDY + columns(rng) + (views(rng, tables) if rng.uniform() < 0.5 else "\n".join(tables))
    for name, content in zip(names, texts, strict=True):
        (study / name).write_text(content, encoding="utf-8")
    (study / "study.toml").write_text(text, encoding="utf-8")
    target = study / names[int(rng.integers(2))] if rng.uniform() < 0.3 else None
    return Call(["check", str(study)], target, work / OUT)


STATED_STUDY = """[study]
name = "stated"
rig = "joint"

[rig]
urdf = "rig.urdf"

[start]
inertia_scale = 1.0
damping = 0.05

"""


@contextlib.contextmanager
def reads_only(really: bool) -> Iterator[None]:
    """Let `check` end before it fits: the causes that trials can show are asked for in other cases."""
    from fes_pin.diagnosis import checked  # noqa: PLC0415

    fits = checked.testable_causes
    try:
        if really:
            checked.testable_causes = lambda *_: "not asked"
        yield
    finally:
        checked.testable_causes = fits


@functools.cache
def _model(rig: str) -> str:
    from fes_pin.models.nominal import nominal_model  # noqa: PLC0415
    from fes_pin.models.store import model_toml  # noqa: PLC0415

    return model_toml(nominal_model(small_study(np.random.default_rng(0), rig)))
