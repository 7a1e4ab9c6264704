"""Answers of a cohort on disk: each complete or absent, so that a run that was killed can go on."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fes_pin.cohort.one import Answer, Work
from fes_pin.data.files import own_json
from fes_pin.data.outputs import Outputs

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

    def get(self, name: str) -> Kept | None:
        """One answer; None if there is none."""
        state = own_json(self.place(name) / STATE)
        if not state:
            return None
        return Kept(name, own_json(self.place(name) / "diagnosis.json"), str(state.get("error", "")))
