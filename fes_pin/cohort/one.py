"""One study of a cohort, as a process of its own or a worker of a cluster diagnoses it, and the answers on disk.

What a worker is given and gives back are plain values: it writes nothing, so that a worker that is killed leaves
nothing behind, and one study that is diagnosed twice is still kept once. Each kept answer is complete or absent, so
that a run that was killed can go on.
"""

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from fes_pin.data.errors import InputError
from fes_pin.data.files import own_json
from fes_pin.data.outputs import Outputs
from fes_pin.data.provenance import hashes, versions
from fes_pin.data.sources import code_hash
from fes_pin.data.study import read_study
from fes_pin.models.catalogue import load_library
from fes_pin.verdict.ask import diagnose
from fes_pin.view.report import answer_files


@dataclass(frozen=True)
class Work:
    """A study that is to be diagnosed.

    Attributes
    ----------
    name
        In the cohort.
    folder
        Of the study.
    seed, limit
        As `diagnose` takes them.
    library
        Files and modules of causes and rigs.
    command
        The command line that asked for it; "" for a call from Python. The answer does not depend on it.
    """

    name: str
    folder: str
    seed: int = 0
    limit: float | None = None
    library: tuple[str, ...] = ()
    command: str = ""

    def key(self) -> str:
        """Return the key of an answer: the study's files, the code, the versions, seed, limit and library."""
        files = [hashlib.sha256(Path(n).read_bytes()).hexdigest() for n in self.library if Path(n).is_file()]
        used = [asdict(self) | {"folder": "", "command": ""}, hashes(Path(self.folder)), versions(), code_hash(), files]
        return hashlib.sha256(json.dumps(used, sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True)
class Answer:
    """The outcome of one study.

    Attributes
    ----------
    name, key
        Of the work.
    files
        Content by name: `diagnosis.json`, `model.toml`, `report.html` ...; empty for a study that failed.
    error
        Why it failed, one line; empty if it did not.
    again
        True if another attempt may succeed: its process died.
    """

    name: str
    key: str
    files: Mapping[str, str | bytes]
    error: str = ""
    again: bool = False


def diagnose_one(work: Work, key: str) -> Answer:
    """Diagnose a study; whatever goes wrong becomes an answer.

    Linear algebra and fits run on one thread: studies are what runs in parallel.
    """
    os.environ["FES_PIN_THREADS"] = "1"
    try:
        return Answer(work.name, key, _files(work))
    except InputError as problem:
        return Answer(work.name, key, {}, str(problem))
    except MemoryError:
        return Answer(work.name, key, {}, "there was not enough memory", again=True)
    except Exception as problem:
        line = " ".join(f"{type(problem).__name__}: {problem}".split())
        return Answer(work.name, key, {}, line[:500])


def _files(work: Work) -> dict[str, str | bytes]:
    catalogue = load_library(*work.library)
    study = read_study(work.folder, rigs=catalogue.schemas())
    brought = None if study.schema.owner is None else catalogue
    found = diagnose(study, library=brought, seed=work.seed, limit=work.limit)
    return answer_files(found.by_command(work.command))


STATE = "state.json"
"""Files next to each answer: the key of what it depends on, its files, and the error if there was one."""


@dataclass(frozen=True)
class Kept:
    """An answer that is on disk: its `diagnosis.json`, empty for a study that failed."""

    name: str
    record: dict[str, Any]
    error: str = ""


class Store:
    """Answers in a folder, one folder each beneath `studies`."""

    def __init__(self, folder: Path, outputs: Outputs) -> None:
        self.folder, self.outputs = folder, outputs

    def place(self, name: str) -> Path:
        """Folder of one study's answer."""
        return self.folder / "studies" / name

    def has(self, work: Work, key: str) -> bool:
        """Return whether a valid answer exists: of the same files, versions, seed, limit and library, and whole."""
        place = self.place(work.name)
        state = own_json(place / STATE)
        is_whole = all((place / name).is_file() for name in state.get("files", ()))
        return is_whole and state.get("key") == key and not state.get("again", False)

    def put(self, answer: Answer) -> None:
        """Keep an answer: all of its files, or none."""
        state = {"key": answer.key, "files": sorted(answer.files), "error": answer.error, "again": answer.again}
        files = {**answer.files, STATE: json.dumps(state) + "\n"}
        place = self.place(answer.name)
        old = {p.name for p in place.iterdir() if p.is_file()} if place.is_dir() else set()
        self.outputs.write(place, files, without=old - set(files))

    def get(self, name: str) -> Kept:
        """One answer that is there."""
        state = own_json(self.place(name) / STATE)
        return Kept(name, own_json(self.place(name) / "diagnosis.json"), str(state.get("error", "")))
