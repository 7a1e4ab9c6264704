"""What a command writes: never over what was read, and only over what the same command wrote and nobody has changed."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fes_pin.data.errors import InputError
from fes_pin.data.files import check_folder, write_bytes, write_files
from fes_pin.data.read_files import refuse_inputs, was_read

RECORD = ".fes_pin.json"
"""In each folder that a command writes into: which files it wrote, and the SHA-256 of each."""


@dataclass(frozen=True)
class Outputs:
    """The writer of one command.

    A file that is there already is written over where `RECORD` in its folder says that the same command wrote it, and
    its content is still the same; any other one only with `force`. A file that was read is never written over.

    Parameters
    ----------
    command
        Its name.
    force
        Whether files of others are written over.
    words
        How a person says so.
    """

    command: str
    force: bool = False
    words: str = "--force"

    def check(self, folder: str | Path, names: Iterable[str]) -> None:
        """Raise where `write` would, before the work that makes the files of these names (or contents by name).

        Raises
        ------
        InputError
            The folder cannot be written, or one of the files must not be written over.
        """
        self._check(Path(folder), names if isinstance(names, Mapping) else dict.fromkeys(names))

    def check_file(self, path: str | Path) -> None:
        """Raise where `write_file` would, as `check`."""
        place = _place(path)
        if place is not None:
            self.check(place.parent, (place.name,))

    def write(self, folder: str | Path, contents: Mapping[str, str | bytes], without: Iterable[str] = ()) -> None:
        """Write files into a folder, all or none, and note there that this command wrote them.

        Parameters
        ----------
        without
            Files that go, where an earlier run of this command wrote them.

        Raises
        ------
        InputError
            As `check` and `write_files`.
        """
        folder = Path(folder)
        with _alone(folder):
            record = self._check(folder, contents)
            gone = [n for n in without if self._wrote(folder / n, record.get(n)) and not was_read(folder / n)]
            kept = {n: entry for n, entry in record.items() if n not in gone and os.path.lexists(folder / n)}
            kept |= {n: {"by": self.command, "sha256": _sha256(content)} for n, content in contents.items()}
            write_files(folder, {RECORD: json.dumps(kept, indent=1) + "\n", **contents}, without=gone)

    def write_file(self, path: str | Path, content: str | bytes) -> None:
        """Write one file into a folder that is there, as `write`; to a special file, such as a pipe, without a note."""
        place = _place(path)
        if place is not None:
            self.write(place.parent, {place.name: content})
        else:
            write_bytes(path, content.encode() if isinstance(content, str) else content)

    def _check(self, folder: Path, contents: Mapping[str, str | bytes | None]) -> dict[str, Any]:
        """The record of the folder, where all files may be written."""
        check_folder(folder)
        record = _record(folder)
        if RECORD in contents:
            raise InputError("is where fes-pin notes what it wrote; expected another name", file=folder / RECORD)
        refuse_inputs(folder / name for name in contents)
        for name, content in contents.items():
            place, entry = folder / name, record.get(name)
            if place.is_dir():
                raise InputError("expected a file to write, found a folder", file=place)
            if not os.path.lexists(place) or self.force or self._wrote(place, entry):
                continue
            if content is not None and place.is_file() and _sha256(content) == _sha256(place.read_bytes()):
                continue
            by = entry["by"] if entry else ""
            why = f"fes-pin {by} wrote it" if by != self.command else f"it was changed since fes-pin {by} wrote it"
            found = f"is there already, and {why if by else f'fes-pin {self.command} did not write it'}"
            raise InputError(f"{found}; expected another place, or {self.words} to write over it", file=place)
        return record

    def _wrote(self, place: Path, entry: Mapping[str, str] | None) -> bool:
        """True of a file that is as this command wrote it."""
        try:
            return bool(entry) and entry == {"by": self.command, "sha256": _sha256(place.read_bytes())}
        except OSError:
            return False


def _place(path: str | Path) -> Path | None:
    """Where a file is written, at the end of symbolic links; None for a special file."""
    path = Path(path)
    refuse_inputs([path])
    try:
        place = path.resolve() if path.is_symlink() else path
        if place.exists() and not (place.is_file() or place.is_dir()):
            return None
        if not place.parent.is_dir():
            raise InputError("cannot be written: the folder does not exist", file=path)
    except (OSError, RuntimeError) as error:
        raise InputError(f"cannot be written: {error}", file=path) from None
    return place


def _record(folder: Path) -> dict[str, Any]:
    """What the folder's record says of files; what cannot be read says nothing."""
    try:
        found = json.loads((folder / RECORD).read_bytes())
    except (OSError, ValueError):
        return {}
    entries = found.items() if isinstance(found, dict) else ()
    return {n: e for n, e in entries if isinstance(e, dict) and set(e) == {"by", "sha256"}}


def _sha256(content: str | bytes) -> str:
    return hashlib.sha256(content.encode() if isinstance(content, str) else content).hexdigest()


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Let no other command write into the folder meanwhile, on a disk that knows locks: its record is one file."""
    handle = None
    try:
        nearest = next(p for p in (folder, *folder.absolute().parents) if p.exists())
        handle = os.open(nearest, os.O_RDONLY)
        fcntl.flock(handle, fcntl.LOCK_EX)
    except OSError:
        pass
    try:
        yield
    finally:
        if handle is not None:
            os.close(handle)
